"""Whether a machine comes to rest: one that is due again at once, whatever is done, would never let anything else be.

A wake may leave something due that is past already, and then another follows. What counts is how many follow each other
of which none leaves the next one later than itself: that is the same on a board, whose clock goes on meanwhile, and in
simulated time, which would stand still for ever.
"""

from dataclasses import dataclass

#: A machine that wakes so often in a row, and is due again no later than it woke, has come to a state in which nothing
#: moves. A busy machine of a full site wakes at most 33 times at one moment (measured at power-up of the large site).
MOST_WAKES = 1_000


@dataclass
class Rest:
    """Counts one machine's wakes in a row; times are loop time in us."""

    wakes: int = 0
    _woke_us: int | None = None

    @property
    def is_broken(self) -> bool:
        """Whether the machine does not come to rest any more."""
        return self.wakes >= MOST_WAKES

    @property
    def is_in_doubt(self) -> bool:
        """Whether the last wakes have brought nothing: a supervisor is told of no progress then."""
        return self.wakes > MOST_WAKES // 10

    @property
    def why(self) -> str:
        """In words, for a person."""
        at_s = (self._woke_us or 0) / 1e6
        return f"the machine's wakes do not come to rest: {self.wakes} in a row, all due at {at_s:.6f} s or before"

    def woke(self, now_us: int) -> None:
        """The machine is woken at loop time ``now_us``; ``due`` says afterwards when it is next."""
        self._woke_us = now_us

    def due(self, due_us: int) -> None:
        """When it is to be woken next."""
        again = self._woke_us is not None and due_us <= self._woke_us
        self.wakes = self.wakes + 1 if again else 0
