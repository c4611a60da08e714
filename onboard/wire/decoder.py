"""One listener's view of a bus: frames in, whole messages out, everything else counted under its reason."""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, cast

from onboard.contract.base import SetFrame
from onboard.contract.codes import Grade, Reason
from onboard.contract.messages import (
    NO_REFERENCE,
    Call,
    CallForProposals,
    CallLoad,
    CallParent,
    CallTerms,
    Itinerary,
    ItineraryHead,
    ItineraryLeg,
    Leg,
    Message,
)
from onboard.core.frame import Frame
from onboard.core.serial import BUS_MS_MODULUS
from onboard.core.site import Machine
from onboard.wire.codec import NO_WHEELBASE_MM, Codec
from onboard.wire.speakers import why_unheard

#: A set is dropped that waits so long for its next frame, us. Legs beyond a sender's budget follow each other slowly
#: (pace.py): 166 ms apart for 26 machines at 125 kbit/s.
SET_TIMEOUT_US = 1_000_000
#: Most incomplete sets kept, and as many whole ones; beyond it the oldest is dropped. Bounds the memory that a babbling
#: node can take.
MAX_SETS = 256

#: Keys of a set: what it is, who says it, under which number.
_Key = tuple[str, int, int]


@dataclass
class _Set:
    """Frames of one set so far, by class, legs of an itinerary by their numbers."""

    heard_us: int
    parts: dict[type[SetFrame] | int, SetFrame] = field(default_factory=dict)


class Decoder:
    """Puts sets of frames together for one listener. ``drops`` counts what came to nothing, by reason."""

    def __init__(
        self, codec: Codec, machines: Mapping[int, Machine] | None = None, *, is_only_one: bool = False
    ) -> None:
        """With ``machines``, those of a site by node-ID, what none of them listens to is dropped too.

        ``is_only_one``: nobody else decodes the same frames, so nothing is remembered for others.
        """
        self.drops: Counter[Reason] = Counter()
        self._codec, self._wholes = codec, codec.wholes
        self._decode = codec.decode_once if is_only_one else codec.decode_part
        self._machines = machines
        self._sets: dict[_Key, _Set] = {}
        #: Sets that were whole, from then on: what is said twice on a bus may come twice.
        self._whole: dict[_Key, _Set] = {}

    def feed(self, frame: Frame, now_us: int) -> Message | None:
        """The message that this frame completes, if any. Never raises, whatever the frame."""
        part = self._decode(frame)
        is_whole = type(part) in self._wholes
        message = cast(Message, part) if is_whole else self._put_together(part, now_us)
        if message is None or self._machines is None:
            return message
        why = why_unheard(message, self._machines, self._codec.speakers)
        if why is Reason.NONE:
            return message
        self.drops[why] += 1
        return None

    def _put_together(self, part: Message | Reason, now_us: int) -> Message | None:
        if isinstance(part, Reason):
            self.drops[part] += 1
            return None
        if _is_old(self._sets, now_us) or _is_old(self._whole, now_us):
            self._expire(now_us)
        feed = self._FEEDS.get(type(part))
        return None if feed is None else feed(self, part, now_us)

    @property
    def unfinished(self) -> int:
        """How many sets wait for more of their frames; at the end of a log they came to nothing."""
        return len(self._sets)

    def _feed_call(self, part: Call | CallTerms | CallLoad | CallParent, now_us: int) -> Message | None:
        key = ("call", part.sender, part.call)
        # Another call under this number, from a sender that has lost count: nothing of the older one may complete it.
        self._drop_other(key, type(part), part)
        if not isinstance(part, Call) and self._is_repeat(key, type(part), part):
            return None
        collected = self._open(key, now_us)
        collected.parts[type(part)] = part
        whole = _call(collected.parts)
        if whole is not None:
            self._complete(key, now_us)
        return whole

    def _feed_head(self, head: ItineraryHead, now_us: int) -> Message | None:
        key = ("itinerary", head.sender, head.version)
        # Another head under this version begins the set anew: legs of the older one must not complete it.
        self._drop_other(key, ItineraryHead, head)
        if head.grade is Grade.RELEASED and head.legs:
            self.drops[Reason.VALUE_OUT_OF_RANGE] += 1
            return None
        collected = self._open(key, now_us)
        collected.parts[ItineraryHead] = head
        return self._itinerary(key, collected, now_us)

    def _feed_leg(self, leg: ItineraryLeg, now_us: int) -> Message | None:
        key = ("itinerary", leg.sender, leg.version)
        self._drop_other(key, leg.leg, leg)
        if key not in self._sets:
            if not self._is_repeat(key, leg.leg, leg):
                self.drops[Reason.INCOMPLETE_SET] += 1
            return None
        collected = self._open(key, now_us)
        collected.parts[leg.leg] = leg
        return self._itinerary(key, collected, now_us)

    def _itinerary(self, key: _Key, collected: _Set, now_us: int) -> Itinerary | None:
        whole = _itinerary(collected.parts)
        if whole is not None:
            self._complete(key, now_us)
        return whole

    #: What takes a part of each class.
    _FEEDS: ClassVar[dict[type[Message], Callable[["Decoder", Any, int], Message | None]]] = {
        **dict.fromkeys((Call, CallTerms, CallLoad, CallParent), _feed_call),
        ItineraryHead: _feed_head,
        ItineraryLeg: _feed_leg,
    }

    def _drop_other(self, key: _Key, place: type[SetFrame] | int, part: SetFrame) -> None:
        """Drop a set that holds this part with another content. A part that comes twice as it was is inert."""
        collected = self._sets.get(key)
        before = collected.parts.get(place) if collected is not None else None
        if before is not None and before != part:
            del self._sets[key]
            self.drops[Reason.INCOMPLETE_SET] += 1

    def _is_repeat(self, key: _Key, place: type[SetFrame] | int, part: SetFrame) -> bool:
        """Whether no set is open and the last whole one had this very part: doubled on the wire, or said again."""
        whole = self._whole.get(key)
        return key not in self._sets and whole is not None and whole.parts.get(place) == part

    def _open(self, key: _Key, now_us: int) -> _Set:
        """The set of a frame, which has its time-out anew."""
        collected = self._sets.pop(key, None)
        if collected is None:
            collected = _Set(now_us)
            if len(self._sets) >= MAX_SETS:
                self._drop_of_the_most()
        collected.heard_us = now_us
        self._sets[key] = collected
        return collected

    def _drop_of_the_most(self) -> None:
        """Make room: of the sender who has the most sets open, the oldest. Nobody drowns another's."""
        senders = Counter(sender for _, sender, _ in self._sets)
        most = max(senders.values())
        del self._sets[next(key for key in self._sets if senders[key[1]] == most)]
        self.drops[Reason.INCOMPLETE_SET] += 1

    def _complete(self, key: _Key, now_us: int) -> None:
        self._whole.pop(key, None)
        self._whole[key] = self._sets.pop(key)
        self._whole[key].heard_us = now_us
        if len(self._whole) > MAX_SETS:
            del self._whole[next(iter(self._whole))]

    def _expire(self, now_us: int) -> None:
        """Sets are in the order of their last frames, so only the first ones can be too old."""
        while _is_old(self._sets, now_us):
            del self._sets[next(iter(self._sets))]
            self.drops[Reason.INCOMPLETE_SET] += 1
        while _is_old(self._whole, now_us):
            del self._whole[next(iter(self._whole))]


def _is_old(sets: dict[_Key, _Set], now_us: int) -> bool:
    for first in sets.values():
        return now_us - first.heard_us > SET_TIMEOUT_US
    return False


def _call(parts: dict[type[SetFrame] | int, SetFrame]) -> CallForProposals | None:
    """The call, where all its frames are there: a sub-call, and no other, has the fourth."""
    call, terms, load, parent = parts.get(Call), parts.get(CallTerms), parts.get(CallLoad), parts.get(CallParent)
    if not (isinstance(call, Call) and isinstance(terms, CallTerms) and isinstance(load, CallLoad)):
        return None
    if not isinstance(parent, CallParent):
        if call.depth:
            return None
        parent = CallParent(call.sender, call.call, NO_REFERENCE, 0, 0)
    return CallForProposals(
        call.sender,
        call.call,
        call.task,
        call.operation,
        call.kind,
        call.criterion,
        call.attempt,
        call.depth,
        terms.deadline_ms,
        terms.from_station,
        load.to_station,
        load.car,
        0 if load.wheelbase_mm == NO_WHEELBASE_MM else load.wheelbase_mm,
        parent.parent,
        call.part,
        parent.ready_ms,
        parent.hold_ms,
    )


def _itinerary(parts: dict[type[SetFrame] | int, SetFrame]) -> Itinerary | None:
    """The itinerary, where its head and all legs that it tells of are there."""
    head = parts.get(ItineraryHead)
    if not isinstance(head, ItineraryHead) or len(parts) <= head.legs:
        return None
    told = [parts.get(number) for number in range(head.legs)]
    legs = tuple(_leg(leg, head.stamp.award_ms) for leg in told if isinstance(leg, ItineraryLeg))
    return Itinerary(head.sender, head.version, head.grade, head.stamp, legs) if len(legs) == head.legs else None


def _leg(leg: ItineraryLeg, award_ms: int) -> Leg:
    end_ms = (award_ms + leg.end_ms) % BUS_MS_MODULUS
    return Leg(leg.action, leg.track, leg.from_index, leg.to_index, leg.side, end_ms)
