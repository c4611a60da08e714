"""Bytes to messages and back, compiled from the DBC: one integer word a frame, one shift and mask a signal.

Input from the wire never raises: what does not fit the contract comes back as a reason. Output that does not fit is our
own mistake and raises ``ValueError``.
"""

import dataclasses
from collections.abc import Callable
from enum import IntEnum
from functools import cache, lru_cache
from operator import attrgetter
from typing import Any, NamedTuple, cast, get_type_hints

from onboard.core import messages as m
from onboard.core import recovery_messages
from onboard.core.codes import Grade, Reason
from onboard.core.frame import Frame
from onboard.core.messages import Leg, Message, Reference, Stamp
from onboard.core.serial import BUS_MS_MODULUS
from onboard.wire.dbc_file import MessageLayout, device_layouts, fleet_layouts
from onboard.wire.speakers import speakers_of

_NODE_MASK = 0xFF
#: What a call says where no car is meant (dbc/fleet.dbc); no site takes cars so short.
NO_WHEELBASE_MM = 1500
#: Decoded frames kept for the other receivers of the same frame: a simulated fleet decodes each frame once.
_MEMORY = 4096


class Part(NamedTuple):
    """One frame of a set of frames: the DBC message's name and its values in the DBC's order of signals."""

    name: str
    sender: int
    values: tuple[Any, ...]


class _Field(NamedTuple):
    """Where a signal is and what it may hold; ``enum`` maps a value to the message's own, None for a plain number."""

    name: str
    shift: int
    mask: int
    sign: int
    scale: int
    offset: int
    minimum: int
    maximum: int
    enum: dict[int, Any] | None


#: (shift, mask, sign, scale, offset, minimum, maximum, enum) of one field.
_Slot = tuple[int, int, int, int, int, int, int, dict[int, Any] | None]


class _Layout(NamedTuple):
    """A message; ``fields`` for people, ``slots`` the same as plain tuples for the two hot loops."""

    name: str
    frame_id: int
    length: int
    fields: tuple[_Field, ...]
    slots: tuple[_Slot, ...]


#: Messages that travel as one frame, by DBC name.
_SINGLE: dict[str, type[Message]] = {
    cls.__name__: cls
    for cls in (vars(m) | vars(recovery_messages)).values()
    if isinstance(cls, type) and issubclass(cls, Message) and cls not in (Message, m.CallForProposals, m.Itinerary)
}

#: Types of the signals of frames that are only a part of a message.
_PART_TYPES: dict[str, dict[str, Any]] = {
    "Call": get_type_hints(m.CallForProposals),
    "CallTerms": get_type_hints(m.CallForProposals),
    "CallLoad": get_type_hints(m.CallForProposals),
    "CallParent": get_type_hints(m.CallForProposals),
    "ItineraryHead": get_type_hints(m.Itinerary),
    "ItineraryLeg": get_type_hints(Leg),
}

_NESTED: dict[Any, tuple[str, ...]] = {
    Reference: tuple(Reference._fields),
    Stamp: tuple(Stamp._fields),
}


def _flat_types(cls: type[Message]) -> dict[str, Any]:
    """Signal name to type, nested tuples flattened as the DBC has them."""
    hints = get_type_hints(cls)
    flat: dict[str, Any] = {}
    for field in dataclasses.fields(cls):
        kind = hints[field.name]
        if field.name == "sender":
            continue
        if kind in _NESTED:
            flat.update({f"{field.name}_{inner}": int for inner in _NESTED[kind]})
        else:
            flat[field.name] = kind
    return flat


def _compile(layout: MessageLayout, single: dict[str, type[Message]]) -> _Layout:
    cls = single.get(layout.name)
    if cls is None and layout.name not in _PART_TYPES:
        raise ValueError(f"the DBC has a message {layout.name} that no class stands for")
    types = _flat_types(cls) if cls is not None else _PART_TYPES[layout.name]
    fields = []
    for signal in layout.signals:
        if signal.scale == 1 and signal.offset:
            raise ValueError(f"{layout.name}.{signal.name}: an offset without a scale is not compiled")
        kind = types.get(signal.name, int)
        enum: dict[int, Any] | None = None
        if isinstance(kind, type) and issubclass(kind, IntEnum):
            enum = {int(member): member for member in kind}
        elif kind is bool:
            enum = {0: False, 1: True}
        sign = 1 << (signal.bits - 1) if signal.signed else 0
        fields.append(
            _Field(
                signal.name,
                signal.shift,
                (1 << signal.bits) - 1,
                sign,
                signal.scale,
                signal.offset,
                signal.minimum,
                signal.maximum,
                enum,
            )
        )
    slots = tuple(tuple(field)[1:] for field in fields)
    return _Layout(layout.name, layout.frame_id, layout.length, tuple(fields), cast("tuple[_Slot, ...]", slots))


def _getter(cls: type[Message], layout: _Layout) -> Callable[[Message], tuple[int, ...]]:
    """A function from a message to its values in the DBC's order, nested tuples flattened."""
    paths = {}
    hints = get_type_hints(cls)
    for field in dataclasses.fields(cls):
        inners = _NESTED.get(hints[field.name])
        if inners is None:
            paths[field.name] = field.name
        else:
            paths.update({f"{field.name}_{inner}": f"{field.name}.{inner}" for inner in inners})
    wanted = [paths[field.name] for field in layout.fields]
    if len(wanted) == 1:
        single = attrgetter(wanted[0])
        return lambda message: (single(message),)
    return attrgetter(*wanted)


def _builder(cls: type[Message], layout: _Layout) -> Callable[[int, tuple[Any, ...]], Message]:
    """A function from (sender, values in the DBC's order) to the message."""
    hints = get_type_hints(cls)
    position = {field.name: number for number, field in enumerate(layout.fields)}
    plan: list[tuple[Any, tuple[int, ...]]] = []
    for field in dataclasses.fields(cls):
        kind = hints[field.name]
        if field.name == "sender":
            continue
        if kind in _NESTED:
            plan.append((kind, tuple(position[f"{field.name}_{inner}"] for inner in _NESTED[kind])))
        else:
            plan.append((None, (position[field.name],)))
    if all(kind is None for kind, _ in plan) and [where[0] for _, where in plan] == list(range(len(plan))):
        return lambda sender, values: cls(sender, *values)

    def build(sender: int, values: tuple[Any, ...]) -> Message:
        arguments = [
            values[where[0]] if kind is None else kind(*[values[number] for number in where]) for kind, where in plan
        ]
        return cls(sender, *arguments)

    return build


class Codec:
    """One bus's contract. ``encode`` and ``decode_part`` are pure; sets of frames are put together by ``Decoder``."""

    def __init__(self, layouts: tuple[MessageLayout, ...], messages: tuple[type[Message], ...] = ()) -> None:
        """``messages`` are a system's own classes, each one frame. ``ValueError`` for a layout without a class."""
        single = _SINGLE | {cls.__name__: cls for cls in messages}
        compiled = [_compile(layout, single) for layout in layouts]
        self._by_name = {layout.name: layout for layout in compiled}
        self._by_id = {layout.frame_id: layout for layout in compiled}
        self._build = {
            layout.name: _builder(single[layout.name], layout) for layout in compiled if layout.name in single
        }
        self._single = {
            layout.name: (layout, _getter(single[layout.name], layout)) for layout in compiled if layout.name in single
        }
        #: Which kinds of machine may say what on the bus, by the DBC.
        self.speakers = speakers_of(layouts, single)
        self._part = lru_cache(maxsize=_MEMORY)(self._decode)

    # --- out ---------------------------------------------------------------------------------------------------

    def encode(self, message: Message) -> tuple[Frame, ...]:
        """The frames of a message, in the order in which they are to be sent.

        Raises ``ValueError``, naming the signal, for a value outside its range, and ``KeyError`` for a message of
        another bus.
        """
        match message:
            case m.CallForProposals():
                return self._encode_call(message)
            case m.Itinerary():
                return self._encode_itinerary(message)
        layout, getter = self._single[type(message).__name__]
        return (self._pack_values(layout, message.sender, getter(message)),)

    def _encode_call(self, call: m.CallForProposals) -> tuple[Frame, ...]:
        values: dict[str, int] = {
            "call": call.call,
            "task_origin": call.task.origin,
            "task_number": call.task.number,
            "operation": call.operation,
            "kind": call.kind,
            "criterion": call.criterion,
            "attempt": call.attempt,
            "depth": call.depth,
            "part": call.part,
            "deadline_ms": call.deadline_ms,
            "from_station": call.from_station,
            "to_station": call.to_station,
            "car_origin": call.car.origin,
            "car_number": call.car.number,
            "wheelbase_mm": _wheelbase_mm(call),
            "parent_origin": call.parent.origin,
            "parent_number": call.parent.number,
            "ready_ms": call.ready_ms,
            "hold_ms": call.hold_ms,
        }
        names = ("Call", "CallTerms", "CallLoad", "CallParent") if call.depth else ("Call", "CallTerms", "CallLoad")
        return tuple(self._pack(name, call.sender, values) for name in names)

    def _encode_itinerary(self, itinerary: m.Itinerary) -> tuple[Frame, ...]:
        stamp = itinerary.stamp
        if itinerary.grade is Grade.RELEASED and itinerary.legs:
            raise ValueError(f"ItineraryHead.legs = {len(itinerary.legs)}: a released itinerary has none")
        head = {
            "version": itinerary.version,
            "grade": itinerary.grade,
            "legs": len(itinerary.legs),
            "stamp_award_ms": stamp.award_ms,
            "stamp_initiator": stamp.initiator,
            "stamp_call": stamp.call,
        }
        frames = [self._pack("ItineraryHead", itinerary.sender, head)]
        for number, leg in enumerate(itinerary.legs):
            values: dict[str, int] = {
                "version": itinerary.version,
                "leg": number,
                "action": leg.action,
                "side": leg.side,
                "track": leg.track,
                "from_index": leg.from_index,
                "to_index": leg.to_index,
                "end_ms": (leg.end_ms - stamp.award_ms) % BUS_MS_MODULUS,
            }
            frames.append(self._pack("ItineraryLeg", itinerary.sender, values))
        return tuple(frames)

    def _pack(self, name: str, sender: int, values: dict[str, int]) -> Frame:
        layout = self._by_name[name]
        return self._pack_values(layout, sender, tuple(values[field.name] for field in layout.fields))

    def _pack_values(self, layout: _Layout, sender: int, values: tuple[int, ...]) -> Frame:
        if not 0 < sender <= _NODE_MASK:
            raise ValueError(f"{layout.name}: sender {sender} is no node-ID")
        word = 0
        for value, (shift, mask, _, scale, offset, minimum, maximum, _) in zip(values, layout.slots, strict=True):
            if value < minimum or value > maximum:
                name = next(field.name for field in layout.fields if field.shift == shift)
                raise ValueError(f"{layout.name}.{name} = {value}: outside {minimum} to {maximum}")
            raw = value if scale == 1 else (value - offset) // scale
            word |= (raw & mask) << shift
        return Frame(layout.frame_id | sender, word.to_bytes(layout.length, "little"))

    # --- in ----------------------------------------------------------------------------------------------------

    def decode_part(self, frame: Frame) -> Message | Part | Reason:
        """A whole message, a part of a set, or why the frame is none."""
        if frame.is_error or frame.is_remote or not frame.is_extended:
            return Reason.UNKNOWN_IDENTIFIER
        return self._part(frame.arbitration_id, frame.data)

    def name_of(self, frame: Frame) -> str | None:
        """The DBC name of a frame's message, or None."""
        layout = self._by_id.get(frame.arbitration_id & ~_NODE_MASK) if frame.is_extended else None
        return layout.name if layout is not None else None

    def _decode(self, arbitration_id: int, data: bytes) -> Message | Part | Reason:
        layout = self._by_id.get(arbitration_id & ~_NODE_MASK)
        sender = arbitration_id & _NODE_MASK
        if layout is None or sender == 0:
            return Reason.UNKNOWN_IDENTIFIER
        if len(data) < layout.length:
            return Reason.SHORT_FRAME
        word = int.from_bytes(data, "little")
        values = []
        for shift, mask, sign, scale, offset, minimum, maximum, enum in layout.slots:
            value: Any = word >> shift & mask
            if value & sign:
                value -= mask + 1
            if scale != 1:
                value = value * scale + offset
            if value < minimum or value > maximum:
                return Reason.VALUE_OUT_OF_RANGE
            if enum is not None:
                value = enum.get(value)
                if value is None:
                    return Reason.VALUE_OUT_OF_RANGE
            values.append(value)
        build = self._build.get(layout.name)
        return build(sender, tuple(values)) if build is not None else Part(layout.name, sender, tuple(values))

    def field_names(self, name: str) -> tuple[str, ...]:
        """Signal names of a DBC message in the order of ``Part.values``."""
        return tuple(field.name for field in self._by_name[name].fields)


def _wheelbase_mm(call: m.CallForProposals) -> int:
    if call.wheelbase_mm == NO_WHEELBASE_MM:
        # A car so short, as somebody stated it: the next value says the same, that no robot can grip it.
        return NO_WHEELBASE_MM + 10
    return call.wheelbase_mm or NO_WHEELBASE_MM


class Codecs(NamedTuple):
    """The contracts of a machine's two buses."""

    fleet: Codec
    device: Codec


def codecs(system: str, messages: tuple[type[Message], ...]) -> Codecs:
    """Both codecs of a system, whose own classes are ``messages``."""
    return Codecs(fleet_codec(system, messages), device_codec(system, messages))


@cache
def fleet_codec(system: str = "", messages: tuple[type[Message], ...] = ()) -> Codec:
    """The codec of the fleet bus, with what a system adds to it and the classes of what it adds anywhere."""
    return Codec(fleet_layouts(system), messages)


@cache
def device_codec(system: str = "", messages: tuple[type[Message], ...] = ()) -> Codec:
    """The codec of a device bus, likewise."""
    return Codec(device_layouts(system), messages)
