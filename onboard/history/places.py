"""Where each machine is, by its own last word; before its first one it is taken to be at home."""

from collections.abc import Iterable
from dataclasses import dataclass

from onboard.contract.messages import Progress
from onboard.core.site import Machine, Segment


@dataclass(frozen=True, slots=True)
class Place:
    """One machine's: ``offset_mm`` along the track from the middle of its segment, speed in mm/s with its sign."""

    segment: Segment
    offset_mm: int = 0
    speed_mm_s: int = 0
    #: When it said so, us of the log; None where it has said nothing yet.
    told_us: int | None = None
    #: Segments left behind since the first word.
    passed: int = 0


@dataclass(frozen=True, slots=True)
class PlaceTold:
    """A machine says where it is; ``before`` None for who is no machine of the site and was not heard before."""

    node: int
    place: Place
    before: Place | None

    @property
    def is_motion(self) -> bool:
        """Whether it moves, or is in another segment than before."""
        return self.place.speed_mm_s != 0 or self.before is None or self.place.segment != self.before.segment


class Places:
    """A fold over progress, by node-ID."""

    def __init__(self, machines: Iterable[Machine]) -> None:
        self.by_node = {machine.node_id: Place(machine.home) for machine in machines}

    def on_progress(self, progress: Progress, time_us: int) -> PlaceTold:
        """Take up one word, at a time of the log in us."""
        before = self.by_node.get(progress.sender)
        segment = Segment(progress.track, progress.index)
        passed = 0 if before is None else before.passed + _segments(before.segment, segment)
        place = Place(segment, progress.offset_mm, progress.speed_mm_s, time_us, passed)
        self.by_node[progress.sender] = place
        return PlaceTold(progress.sender, place, before)


def _segments(before: Segment, now: Segment) -> int:
    """From one to the other; to another track it is one, and not each is told while a machine moves."""
    return abs(now.index - before.index) if now.track == before.track else 1
