"""Every interleaving of machines whose bodies take their time: each goes on by itself, beside all words.

A body that is on its way arrives before a while has passed; what sensors see of other bodies is told within it.
"""

from collections.abc import Hashable, Iterator
from typing import Any, Protocol

from tests.models.engine import Engine, Limits, Part, State, Step


class MovingPart(Part, Protocol):
    """What is explored, with bodies that move."""

    def goes_on(self, body: Any) -> Hashable | None:
        """What happens next to a body by itself while its controller is up; None while it rests."""

    def feels(self, i: int, view: Any, bodies: tuple[Any, ...]) -> Hashable | None:
        """What a machine's sensors see of all bodies, where it is not what they saw last; else None."""


class MovingEngine(Engine):
    """As ``Engine``; bodies of machines that are up go on, and feel each other."""

    part: MovingPart

    def _bodies(self, state: State) -> tuple[Any, ...]:
        return tuple([self._lasting.things[number].body for number in state.lasting])

    def _own(self, state: State) -> list[tuple[int, Any, str]]:
        """What comes about by itself: motion, and what sensors see that they have not told yet."""
        part, bodies, found = self.part, self._bodies(state), []
        for i, mind in enumerate(state.minds):
            if mind is None:
                continue
            felt, moves = part.feels(i, self._views[mind], bodies), part.goes_on(bodies[i])
            found += [(i, felt, "feels")] if felt is not None else []
            found += [(i, moves, "moves")] if moves is not None else []
        return found

    def _at_any_time(self, state: State) -> Iterator[tuple[State, Step]]:
        """Crashes and starts, and what comes about by itself."""
        yield from super()._at_any_time(state)
        for i, event, what in self._own(state):
            mind = state.minds[i]
            assert mind is not None
            after, deeds = self._does(i, mind, event)
            if self._within[after]:
                yield from self._outcomes(state, i, after, deeds, (what, i, event, -1))

    def _while(self, state: State) -> Iterator[tuple[State, Step]]:
        """Within a while all bodies arrive, and sensors tell it."""
        if not self._own(state):
            yield from super()._while(state)

    def _all_hear(self, state: State, heard: list[int] | None = None) -> State:
        """And whatever moves arrives."""
        heard = [0] * len(self.nodes) if heard is None else heard
        while True:
            state = super()._all_hear(state, heard)
            own = self._own(state)
            if not own:
                return state
            for i, event, _ in own:
                mind = state.minds[i]
                assert mind is not None
                state = self._all_done(state, i, *self._does(i, mind, event))

    def _seen(self, state: State) -> tuple[Any, ...]:
        """Of a machine that is down its body."""
        views = zip(super()._seen(state), self._bodies(state), strict=True)
        return tuple([body if view is None else view for view, body in views])

    def _judged_by(self, state: State) -> Hashable:
        return state.minds if None not in state.minds else (state.minds, state.lasting)


def engine_of(part: Part, limits: Limits) -> Engine:
    """What explores a part: with motion where it has bodies that move."""
    return MovingEngine(part, limits) if hasattr(part, "goes_on") else Engine(part, limits)
