"""Message objects to frames and back, by the functions that are generated from the DBC files (``onboard/contract``).

Input from the wire never raises: what does not fit the contract comes back as a reason. Output that does not fit is our
own mistake and raises ``ValueError``.
"""

from collections.abc import Callable
from functools import cache, lru_cache
from typing import Any, NamedTuple

from onboard.contract.base import FrameCode, SetFrame
from onboard.contract.codes import Grade, Reason
from onboard.contract.messages import (
    Call,
    CallForProposals,
    CallLoad,
    CallParent,
    CallTerms,
    Itinerary,
    ItineraryHead,
    ItineraryLeg,
    Message,
)
from onboard.contract.packing import (
    announce,
    announce_device,
    battery,
    calls,
    change,
    device,
    plans,
    presence,
    rights,
    seal,
)
from onboard.core.frame import Frame
from onboard.core.serial import BUS_MS_MODULUS
from onboard.wire.speakers import speakers_of

_NODE_MASK = 0xFF
#: What a call says where no car is meant (dbc/fleet.dbc); no site takes cars so short.
NO_WHEELBASE_MM = 1500
#: Decoded frames kept for the other receivers of the same frame: a simulated fleet decodes each frame once.
_MEMORY = 1024
#: Frames of the two contracts of all.
_FLEET = (
    *presence.FRAMES,
    *rights.FRAMES,
    *calls.FRAMES,
    *plans.FRAMES,
    *seal.FRAMES,
    *battery.FRAMES,
    *change.FRAMES,
    *announce.FRAMES,
)
_DEVICE = (*device.FRAMES, *announce_device.FRAMES)
#: ``Frame`` from a tuple of all its fields: half the time of naming those that are not as usual.
_frame_of: Callable[[type[Frame], Any], Frame] = tuple.__new__


class Codec:
    """One bus's contract. ``encode`` and ``decode_part`` are pure; sets of frames are put together by ``Decoder``."""

    def __init__(self, frames: tuple[FrameCode, ...]) -> None:
        """``frames`` are all that are said on the bus, by whomever."""
        self._by_id = {one.identifier: one for one in frames}
        self._identifiers = {one.name: one.identifier for one in frames}
        self._packs = {one.frame: (one.identifier, one.pack) for one in frames}
        #: Messages of one frame; all others are put together of several.
        self.wholes = frozenset(one.frame for one in frames if not issubclass(one.frame, SetFrame))
        self._wholes = {one.identifier: (one.length, one.unpack) for one in frames if one.frame in self.wholes}
        #: Which kinds of machine may say what on the bus, by the DBC.
        self.speakers = speakers_of(frames)
        #: A whole message, a part of a set (``SetFrame``), or why the frame is none.
        self.decode_part = lru_cache(maxsize=_MEMORY)(self.decode_once)

    # --- out ---------------------------------------------------------------------------------------------------

    def encode(self, message: Message) -> tuple[Frame, ...]:
        """The frames of a message, in the order in which they are to be sent.

        Raises ``ValueError``, naming the signal, for a value outside its range, and ``KeyError`` for a message of
        another bus.
        """
        parts = _SETS.get(type(message))
        if parts is not None:
            return tuple(self._encode(part) for part in parts(message))
        return (self._encode(message),)

    def _encode(self, message: Message) -> Frame:
        identifier, pack = self._packs[type(message)]
        sender = message.sender
        if not 0 < sender <= _NODE_MASK:
            raise ValueError(f"{type(message).__name__}: sender {sender} is no node-ID")
        return _frame_of(Frame, (identifier | sender, pack(message), True, False, False, 0))

    # --- in ----------------------------------------------------------------------------------------------------

    def whole(self, arbitration_id: int, data: bytes) -> Message | None:
        """The message of a classic data frame with a 29-bit identifier; None for a part of a set and what is none.

        Nothing is remembered, as in ``decode_once``.
        """
        sender = arbitration_id & _NODE_MASK
        found = self._wholes.get(arbitration_id - sender)
        if found is None or not sender or len(data) < found[0]:
            return None
        return found[1](sender, data)

    def identifier_of(self, name: str) -> int:
        """The identifier of a message by its DBC name, node-ID 0. Raises ``KeyError`` for a message of another bus."""
        return self._identifiers[name]

    def name_of(self, frame: Frame) -> str | None:
        """The DBC name of a frame's message, or None."""
        found = self._by_id.get(frame.arbitration_id & ~_NODE_MASK) if frame.is_extended else None
        return found.name if found is not None else None

    def decode_once(self, frame: Frame) -> Message | Reason:
        """The same as ``decode_part``, and nothing is remembered: of a log each frame has one reader."""
        arbitration_id, data, is_extended, is_remote, is_error, _ = frame
        if is_error or is_remote or not is_extended:
            return Reason.UNKNOWN_IDENTIFIER
        found = self._by_id.get(arbitration_id & ~_NODE_MASK)
        sender = arbitration_id & _NODE_MASK
        if found is None or sender == 0:
            return Reason.UNKNOWN_IDENTIFIER
        if len(data) < found.length:
            return Reason.SHORT_FRAME
        message = found.unpack(sender, data)
        return Reason.VALUE_OUT_OF_RANGE if message is None else message


def _parts_of_call(call: CallForProposals) -> tuple[Message, ...]:
    sender, number = call.sender, call.call
    operation = (call.operation, call.kind, call.criterion)
    call_and_terms = (
        Call(sender, number, call.task, *operation, call.attempt, call.depth, call.part),
        CallTerms(sender, number, call.deadline_ms, call.from_station),
    )
    load = CallLoad(sender, number, call.to_station, call.car, _wheelbase_mm(call))
    if not call.depth and not call.ready_ms:
        return (*call_and_terms, load)
    parent = CallParent(sender, number, call.parent, call.ready_ms, call.hold_ms)
    # A call of its own is whole with its load: what tells when it can begin comes before that.
    return (*call_and_terms, load, parent) if call.depth else (*call_and_terms, parent, load)


def _parts_of_itinerary(itinerary: Itinerary) -> tuple[Message, ...]:
    sender, version, stamp = itinerary.sender, itinerary.version, itinerary.stamp
    if itinerary.grade is Grade.RELEASED and itinerary.legs:
        raise ValueError(f"ItineraryHead.legs = {len(itinerary.legs)}: a released itinerary has none")
    head = ItineraryHead(sender, version, itinerary.grade, len(itinerary.legs), stamp)
    legs = [
        ItineraryLeg(
            sender,
            version,
            leg.action,
            number,
            leg.side,
            leg.track,
            leg.from_index,
            leg.to_index,
            (leg.end_ms - stamp.award_ms) % BUS_MS_MODULUS,
        )
        for number, leg in enumerate(itinerary.legs)
    ]
    return (head, *legs)


#: What takes a message of several frames apart.
_SETS: dict[type[Message], Callable[[Any], tuple[Message, ...]]] = {
    CallForProposals: _parts_of_call,
    Itinerary: _parts_of_itinerary,
}


def is_one_frame(message: Message) -> bool:
    """Whether a message of either bus is one frame, not a set."""
    return type(message) not in _SETS


def _wheelbase_mm(call: CallForProposals) -> int:
    if call.wheelbase_mm == NO_WHEELBASE_MM:
        # A car so short, as somebody stated it: the next value says the same, that no robot can grip it.
        return NO_WHEELBASE_MM + 10
    return call.wheelbase_mm or NO_WHEELBASE_MM


class Codecs(NamedTuple):
    """The contracts of a machine's two buses."""

    fleet: Codec
    device: Codec


@cache
def codecs(frames: tuple[FrameCode, ...] = ()) -> Codecs:
    """Both codecs of a system, whose own frames, of either bus, are ``frames``."""
    fleet = (*_FLEET, *(one for one in frames if not one.is_device))
    return Codecs(Codec(fleet), Codec((*_DEVICE, *(one for one in frames if one.is_device))))


def fleet_codec() -> Codec:
    """The codec of the fleet bus as all systems have it."""
    return codecs().fleet


def device_codec() -> Codec:
    """The codec of a device bus as all systems have it."""
    return codecs().device
