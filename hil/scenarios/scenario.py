"""A scenario as data: what happens, what it asks of the bench, and what of it may look like a fault."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from hil.bench import Capability
from hil.stage import Stage
from onboard.core.codes import KindCode, Reason

#: What the fleet of a bench does without: the second robot, so that the device has no rival.
NO_RIVAL = frozenset({"MR2"})


@dataclass(frozen=True, slots=True)
class Scenario:
    """``play`` raises ``AssertionError`` where the device does something else than it should.

    ``needs``: capabilities of the bench. ``kinds``: kinds of machine that can do this; none for all. ``without``:
    machines of the site that nobody runs. ``drops``: reasons for which the device may drop input here.
    ``wire_errors``: error counters may rise. ``late``: frames may be lost or leave late. ``ends``: the device stops.
    """

    name: str
    play: Callable[[Stage], Awaitable[None]]
    needs: frozenset[Capability]
    kinds: frozenset[KindCode] = frozenset()
    without: frozenset[str] = NO_RIVAL
    drops: frozenset[Reason] = frozenset()
    wire_errors: bool = False
    late: bool = False
    ends: bool = False

    @property
    def is_disturbed(self) -> bool:
        """Whether rules that need every frame are left out of the judgement."""
        return self.wire_errors or self.late or self.ends
