"""Which slots the bodies of machines that stand are in, by their own last words: pushed by hand, without the rights.

Whoever drives holds the rights to what it is in; who was pushed has to ask for them first. Until it has them the slot's
token is somebody's who may not give it to a third: there are two bodies in it then.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

from onboard.contract.messages import Progress
from onboard.core.site import Segment
from onboard.ways.lifts import MARK_TOLERANCE_MM
from onboard.ways.site import TrackKind, WaySite


def slots_of_body(site: WaySite, word: Progress) -> Iterator[Segment]:
    """Slots of its own track that a carrier is in which is where ``word`` says; none of a lift, and of no track."""
    track = site.tracks.get(word.track)
    if track is None or track.kind is TrackKind.LIFT:
        return
    half_mm = site.carrier_length_mm // 2 + track.pitch_mm // 2 - MARK_TOLERANCE_MM
    centre_mm = word.index * track.pitch_mm + word.offset_mm
    for index in range(1 + (centre_mm - half_mm) // track.pitch_mm, -(-(centre_mm + half_mm) // track.pitch_mm)):
        if 1 <= index <= track.length:
            yield Segment(word.track, index)


@dataclass
class Bodies:
    """What one machine heard of where bodies stand."""

    site: WaySite
    _slots: dict[int, set[Segment]] = field(default_factory=dict)

    def hear(self, word: Progress) -> None:
        """A machine says where it is: while it moves it has the rights, and is soon elsewhere."""
        self._slots[word.sender] = set() if word.speed_mm_s else {*slots_of_body(self.site, word)}

    def left(self, node: int, slot: Segment) -> None:
        """It gave the slot's token back: it is not in it any more, though the word that said so may be lost."""
        self._slots.get(node, set()).discard(slot)

    def is_in(self, node: int, slot: Segment) -> bool:
        """Whether a machine stands in a slot."""
        return slot in self._slots.get(node, ())

    def is_another_in(self, slot: Segment, node: int) -> bool:
        """Whether any machine but ``node`` stands in a slot."""
        return any(slot in slots for other, slots in self._slots.items() if other != node)
