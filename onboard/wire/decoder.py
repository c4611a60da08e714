"""One listener's view of a bus: frames in, whole messages out, everything else counted under its reason."""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from onboard.core.codes import Reason
from onboard.core.frame import Frame
from onboard.core.messages import CallForProposals, Itinerary, Leg, Message, Reference, Stamp
from onboard.core.serial import BUS_MS_MODULUS
from onboard.wire.codec import Codec, Part

#: A set whose frames do not all come within this is dropped, us. A set is sent in one go: milliseconds.
SET_TIMEOUT_US = 1_000_000
#: Most incomplete sets kept; beyond it the oldest is dropped. Bounds the memory that a babbling node can take.
MAX_SETS = 256

_CALL_PARTS = frozenset({"Call", "CallTerms", "CallLoad"})


@dataclass
class _Set:
    """Frames of one set so far. For an itinerary ``parts`` is keyed by leg number, -1 for the head."""

    started_us: int
    parts: dict[str | int, tuple[Any, ...]] = field(default_factory=dict)


class Decoder:
    """Puts sets of frames together for one listener. ``drops`` counts what came to nothing, by reason."""

    def __init__(self, codec: Codec) -> None:
        self.drops: Counter[Reason] = Counter()
        self._codec = codec
        self._sets: dict[tuple[str, int, int], _Set] = {}

    def feed(self, frame: Frame, now_us: int) -> Message | None:
        """The message that this frame completes, if any. Never raises, whatever the frame."""
        part = self._codec.decode_part(frame)
        if isinstance(part, Message):
            return part
        if isinstance(part, Reason):
            self.drops[part] += 1
            return None
        if self._sets:
            self._expire(now_us)
        if part.name in _CALL_PARTS:
            return self._feed_call(part, now_us)
        return self._feed_itinerary(part, now_us)

    def _feed_call(self, part: Part, now_us: int) -> Message | None:
        key = ("call", part.sender, part.values[0])
        # Another call under this number, from a sender that has lost count: nothing of the older one may complete it.
        self._drop_other(key, part.name, part.values)
        collected = self._open(key, now_us)
        collected.parts[part.name] = part.values
        if len(collected.parts) < len(_CALL_PARTS):
            return None
        del self._sets[key]
        call, task_origin, task_number, operation, kind, criterion, attempt, depth = collected.parts["Call"]
        _, deadline_ms, from_station = collected.parts["CallTerms"]
        _, to_station, car_origin, car_number, wheelbase_mm = collected.parts["CallLoad"]
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
            wheelbase_mm,
        )

    def _feed_itinerary(self, part: Part, now_us: int) -> Message | None:
        key = ("itinerary", part.sender, part.values[0])
        if part.name == "ItineraryHead":
            # Another head under this version begins the set anew: legs of the older one must not complete it.
            self._drop_other(key, -1, part.values)
            collected = self._open(key, now_us)
            collected.parts[-1] = part.values
        else:
            self._drop_other(key, part.values[2], part.values)
            found = self._sets.get(key)
            if found is None:
                self.drops[Reason.INCOMPLETE_SET] += 1
                return None
            collected = found
            collected.parts[part.values[2]] = part.values
        version, grade, count, award_ms, initiator, call = collected.parts[-1]
        if any(number not in collected.parts for number in range(count)):
            return None
        del self._sets[key]
        legs = tuple(_leg(collected.parts[number], award_ms) for number in range(count))
        return Itinerary(part.sender, version, grade, Stamp(award_ms, initiator, call), legs)

    def _drop_other(self, key: tuple[str, int, int], name: str | int, values: tuple[Any, ...]) -> None:
        """Drop a set that holds this part with another content. A part that comes twice as it was is inert."""
        collected = self._sets.get(key)
        if collected is not None and collected.parts.get(name, values) != values:
            del self._sets[key]
            self.drops[Reason.INCOMPLETE_SET] += 1

    def _open(self, key: tuple[str, int, int], now_us: int) -> _Set:
        collected = self._sets.get(key)
        if collected is None:
            collected = self._sets[key] = _Set(now_us)
            if len(self._sets) > MAX_SETS:
                del self._sets[next(iter(self._sets))]
                self.drops[Reason.INCOMPLETE_SET] += 1
        return collected

    def _expire(self, now_us: int) -> None:
        """Sets are in the order of their start, so only the first ones can be too old."""
        while self._sets:
            key = next(iter(self._sets))
            if now_us - self._sets[key].started_us <= SET_TIMEOUT_US:
                return
            del self._sets[key]
            self.drops[Reason.INCOMPLETE_SET] += 1


def _leg(values: tuple[Any, ...], award_ms: int) -> Leg:
    _, action, _, side, track, from_index, to_index, end_ms = values
    return Leg(action, track, from_index, to_index, side, (award_ms + end_ms) % BUS_MS_MODULUS)
