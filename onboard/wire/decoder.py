"""One listener's view of a bus: frames in, whole messages out, everything else counted under its reason."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from onboard.core.codes import Grade, Reason
from onboard.core.frame import Frame
from onboard.core.messages import CallForProposals, Itinerary, Leg, Message, Reference, Stamp
from onboard.core.serial import BUS_MS_MODULUS
from onboard.core.site import Machine
from onboard.wire.codec import NO_WHEELBASE_MM, Codec, Part
from onboard.wire.speakers import why_unheard

#: A set whose frames do not all come within this is dropped, us. A set is sent in one go: milliseconds.
SET_TIMEOUT_US = 1_000_000
#: Most incomplete sets kept, and as many whole ones; beyond it the oldest is dropped. Bounds the memory that a babbling
#: node can take.
MAX_SETS = 256

_CALL_PARTS = frozenset({"Call", "CallTerms", "CallLoad", "CallParent"})
_EVERY_CALLS_PARTS = _CALL_PARTS - {"CallParent"}


@dataclass
class _Set:
    """Frames of one set so far. For an itinerary ``parts`` is keyed by leg number, -1 for the head."""

    started_us: int
    parts: dict[str | int, tuple[Any, ...]] = field(default_factory=dict)


class Decoder:
    """Puts sets of frames together for one listener. ``drops`` counts what came to nothing, by reason."""

    def __init__(self, codec: Codec, machines: Mapping[int, Machine] | None = None) -> None:
        """With ``machines``, those of a site by node-ID, what none of them listens to is dropped too."""
        self.drops: Counter[Reason] = Counter()
        self._codec = codec
        self._machines = machines
        self._sets: dict[tuple[str, int, int], _Set] = {}
        #: Sets that were whole, from then on: what is said twice on a bus may come twice.
        self._whole: dict[tuple[str, int, int], _Set] = {}

    def feed(self, frame: Frame, now_us: int) -> Message | None:
        """The message that this frame completes, if any. Never raises, whatever the frame."""
        message = self._put_together(frame, now_us)
        if message is None or self._machines is None:
            return message
        why = why_unheard(message, self._machines, self._codec.speakers)
        if why is Reason.NONE:
            return message
        self.drops[why] += 1
        return None

    def _put_together(self, frame: Frame, now_us: int) -> Message | None:
        part = self._codec.decode_part(frame)
        if isinstance(part, Message):
            return part
        if isinstance(part, Reason):
            self.drops[part] += 1
            return None
        if self._sets or self._whole:
            self._expire(now_us)
        if part.name in _CALL_PARTS:
            return self._feed_call(part, now_us)
        return self._feed_itinerary(part, now_us)

    @property
    def unfinished(self) -> int:
        """How many sets wait for more of their frames; at the end of a log they came to nothing."""
        return len(self._sets)

    def _feed_call(self, part: Part, now_us: int) -> Message | None:
        key = ("call", part.sender, part.values[0])
        # Another call under this number, from a sender that has lost count: nothing of the older one may complete it.
        self._drop_other(key, part.name, part.values)
        if part.name != "Call" and self._is_repeat(key, part.name, part.values):
            return None
        collected = self._open(key, now_us, begins=part.name == "Call")
        collected.parts[part.name] = part.values
        if not _is_whole_call(collected.parts):
            return None
        self._complete(key, now_us)
        call, task_origin, task_number, operation, kind, criterion, attempt, depth, part_number = collected.parts[
            "Call"
        ]
        _, deadline_ms, from_station = collected.parts["CallTerms"]
        _, to_station, car_origin, car_number, wheelbase_mm = collected.parts["CallLoad"]
        _, parent_origin, parent_number, ready_ms, hold_ms = collected.parts.get("CallParent", (call, 0, 0, 0, 0))
        return CallForProposals(
            part.sender,
            call,
            Reference(task_origin, task_number),
            operation,
            kind,
            criterion,
            attempt,
            depth,
            deadline_ms,
            from_station,
            to_station,
            Reference(car_origin, car_number),
            0 if wheelbase_mm == NO_WHEELBASE_MM else wheelbase_mm,
            Reference(parent_origin, parent_number),
            part_number,
            ready_ms,
            hold_ms,
        )

    def _feed_itinerary(self, part: Part, now_us: int) -> Message | None:
        key = ("itinerary", part.sender, part.values[0])
        if part.name == "ItineraryHead":
            # Another head under this version begins the set anew: legs of the older one must not complete it.
            self._drop_other(key, -1, part.values)
            if part.values[1] is Grade.RELEASED and part.values[2]:
                self.drops[Reason.VALUE_OUT_OF_RANGE] += 1
                return None
            collected = self._open(key, now_us, begins=True)
            collected.parts[-1] = part.values
        else:
            self._drop_other(key, part.values[2], part.values)
            found = self._sets.get(key)
            if found is None:
                if not self._is_repeat(key, part.values[2], part.values):
                    self.drops[Reason.INCOMPLETE_SET] += 1
                return None
            collected = found
            collected.parts[part.values[2]] = part.values
        version, grade, count, award_ms, initiator, call = collected.parts[-1]
        if any(number not in collected.parts for number in range(count)):
            return None
        self._complete(key, now_us)
        legs = tuple(_leg(collected.parts[number], award_ms) for number in range(count))
        return Itinerary(part.sender, version, grade, Stamp(award_ms, initiator, call), legs)

    def _drop_other(self, key: tuple[str, int, int], name: str | int, values: tuple[Any, ...]) -> None:
        """Drop a set that holds this part with another content. A part that comes twice as it was is inert."""
        collected = self._sets.get(key)
        if collected is not None and collected.parts.get(name, values) != values:
            del self._sets[key]
            self.drops[Reason.INCOMPLETE_SET] += 1

    def _is_repeat(self, key: tuple[str, int, int], name: str | int, values: tuple[Any, ...]) -> bool:
        """Whether no set is open and the last whole one had this very part: doubled on the wire, or said again."""
        whole = self._whole.get(key)
        return key not in self._sets and whole is not None and whole.parts.get(name) == values

    def _open(self, key: tuple[str, int, int], now_us: int, *, begins: bool) -> _Set:
        """The set of a frame. One that ``begins`` a set and comes again says that all of it is being sent again."""
        collected = self._sets.pop(key, None) if begins else self._sets.get(key)
        if collected is None:
            collected = _Set(now_us)
            if len(self._sets) >= MAX_SETS:
                self._drop_of_the_most()
        elif begins:
            collected.started_us = now_us
        self._sets[key] = collected
        return collected

    def _drop_of_the_most(self) -> None:
        """Make room: of the sender who has the most sets open, the oldest. Nobody drowns another's."""
        senders = Counter(sender for _, sender, _ in self._sets)
        most = max(senders.values())
        del self._sets[next(key for key in self._sets if senders[key[1]] == most)]
        self.drops[Reason.INCOMPLETE_SET] += 1

    def _complete(self, key: tuple[str, int, int], now_us: int) -> None:
        self._whole.pop(key, None)
        self._whole[key] = self._sets.pop(key)
        self._whole[key].started_us = now_us
        if len(self._whole) > MAX_SETS:
            del self._whole[next(iter(self._whole))]

    def _expire(self, now_us: int) -> None:
        """Sets are in the order of their start, so only the first ones can be too old."""
        while self._sets and _is_old(self._sets, now_us):
            del self._sets[next(iter(self._sets))]
            self.drops[Reason.INCOMPLETE_SET] += 1
        while self._whole and _is_old(self._whole, now_us):
            del self._whole[next(iter(self._whole))]


def _is_old(sets: dict[tuple[str, int, int], _Set], now_us: int) -> bool:
    return now_us - sets[next(iter(sets))].started_us > SET_TIMEOUT_US


def _is_whole_call(parts: dict[str | int, tuple[Any, ...]]) -> bool:
    """Whether all frames are there: a sub-call, and no other, has the fourth."""
    if not all(name in parts for name in _EVERY_CALLS_PARTS):
        return False
    depth = parts["Call"][7]
    return depth == 0 or "CallParent" in parts


def _leg(values: tuple[Any, ...], award_ms: int) -> Leg:
    _, action, _, side, track, from_index, to_index, end_ms = values
    return Leg(action, track, from_index, to_index, side, (award_ms + end_ms) % BUS_MS_MODULUS)
