"""What a polishing shop says beyond the messages of all: four frames on its device buses, a number each."""

from struct import Struct

from onboard.contract.base import FrameCode, Message, message

_NUMBER = Struct("<Hxxxxxx")


@message(frozen=True, slots=True)
class Polish(Message):
    """A polisher's controller: begin with this part. A number that was begun is done once."""

    number: int


@message(frozen=True, slots=True)
class PartOut(Message):
    """The desk: this part is done."""

    number: int


@message(frozen=True, slots=True)
class Polished(Message):
    """A polisher's motor: this part is done."""

    number: int


@message(frozen=True, slots=True)
class PartIn(Message):
    """The desk's rack: this part has come, numbered from 1; said again until it is out."""

    number: int


def _code(kind: type[Message], identifier: int, sender: str) -> FrameCode:
    def pack(said: Polish | PartOut | Polished | PartIn) -> bytes:
        return _NUMBER.pack(said.number)

    def unpack(node: int, data: bytes) -> Message | None:
        make: type = kind
        said: Message = make(node, *_NUMBER.unpack_from(data))
        return said

    return FrameCode(kind.__name__, identifier, 8, pack, unpack, kind, kind, (sender,), True)


#: Orders to devices have priority 5, what they say 5 and a half (docs/network.md); the sender is the lowest byte.
FRAMES = (
    _code(Polish, 0x14E80000, "Controller"),
    _code(PartOut, 0x14E90000, "Controller"),
    _code(Polished, 0x16EA0000, "Motor"),
    _code(PartIn, 0x16EB0000, "Rack"),
)
