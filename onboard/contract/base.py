"""What the generated modules of the contract are made of. Nothing here knows any message.

Messages are frozen dataclasses to a type checker and to ``dataclasses.replace``. At run time nothing stops an
assignment: a frame is decoded into a message for every frame on the bus, and a guard against what mypy refuses anyway
costs three quarters of the time that making one takes (bench/codec.py).
"""

from collections.abc import Callable
from dataclasses import field, make_dataclass
from functools import cache
from operator import attrgetter
from types import CodeType, FunctionType
from typing import TYPE_CHECKING, Any, NamedTuple

__all__ = [
    "NO_REFERENCE",
    "FrameCode",
    "Message",
    "OutOfRangeError",
    "Reference",
    "SetFrame",
    "Stamp",
    "message",
    "refusal",
]

if TYPE_CHECKING:
    from dataclasses import dataclass as message
else:

    def message(**_options):
        """Class decorator for a type checker's ``dataclass(frozen=True, slots=True)``, made in a tenth of its time."""
        return _slotted


class Reference(NamedTuple):
    """A task or a car: the node that named it and its 16-bit number there (serial arithmetic, RFC 1982)."""

    origin: int
    number: int


#: No task, no car, no call.
NO_REFERENCE = Reference(0, 0)


class Stamp(NamedTuple):
    """Rank of a firm itinerary: lower keeps its windows. Order: award (bus ms), initiator, low byte of the call."""

    award_ms: int
    initiator: int
    call: int


class OutOfRangeError(ValueError):
    """A value that its signal cannot hold; the text names message, signal, value and range."""

    def __init__(self, signal: str, value: int, minimum: int, maximum: int) -> None:
        super().__init__(f"{signal} = {value}: outside {minimum} to {maximum}")


def refusal(message: object, *ranges: tuple[str, int, int]) -> ValueError:
    """Why a message could not be packed: ``ranges`` are fields ("CarAt.car.number"), the least and the most they hold.

    The generated functions leave to ``struct`` the checks that it makes anyway, and ask here what it did not like.
    """
    for where, minimum, maximum in ranges:
        name, _, path = where.partition(".")
        value = attrgetter(path)(message)
        if not minimum <= value <= maximum:
            return OutOfRangeError(f"{name}.{path.replace('.', '_')}", value, minimum, maximum)
    return ValueError(f"{message}: a field is no whole number")


class _Fields:
    """The fields of a message class as the standard library's ``dataclasses`` want them, made when first asked for."""

    def __get__(self, instance: object, owner: Any) -> dict[str, Any]:
        kinds = {name: kind for cls in reversed(owner.__mro__) for name, kind in vars(cls).get("kinds", {}).items()}
        found: Any = make_dataclass(
            owner.__name__,
            [
                (name, kind, field(default=owner.defaults[name])) if name in owner.defaults else (name, kind)
                for name, kind in kinds.items()
            ],
        )
        owner.__dataclass_fields__ = found.__dataclass_fields__
        return dict(found.__dataclass_fields__)


@cache
def _template(count: int) -> CodeType:
    """The code of an ``__init__`` that takes and stores so many fields; only the names differ between classes.

    To compile a text for each class, as ``dataclasses`` does, takes a board a tenth of its start.
    """
    names = [f"field_{number}" for number in range(count)]
    lines = "\n".join(f" self.{name} = {name}" for name in names)
    made: dict[str, Any] = {}
    exec(f"def __init__(self, {', '.join(names)}):\n{lines}", made)  # noqa: S102  # nothing of it comes from outside
    code: CodeType = made["__init__"].__code__
    return code


def _slotted(cls: Any) -> Any:
    """The class anew, with slots for its annotations and an ``__init__`` that fills them."""
    content = {key: value for key, value in vars(cls).items() if key not in ("__dict__", "__weakref__")}
    kinds = content.pop("__annotations__", {})
    defaults = {name: content.pop(name) for name in kinds if name in content}
    names = (*getattr(cls.__base__, "__match_args__", ()), *kinds)
    code = _template(len(names)).replace(co_names=names, co_varnames=("self", *names))
    made = FunctionType(code, {}, "__init__", tuple(defaults.values()) or None)
    made.__qualname__ = f"{cls.__name__}.__init__"
    content |= {"__slots__": tuple(kinds), "__match_args__": names, "__init__": made}
    content |= {"kinds": kinds, "defaults": defaults, "values_of": staticmethod(attrgetter(*names))}
    return type(cls)(cls.__name__, cls.__bases__, content)


@message(frozen=True, slots=True)
class Message:
    """Base of all messages; ``sender`` is a node-ID, 1 to 255."""

    sender: int

    if not TYPE_CHECKING:
        __dataclass_fields__ = _Fields()

        def __eq__(self, other):
            return type(self) is type(other) and self.values_of(self) == other.values_of(other)

        def __hash__(self):
            return hash((type(self), self.values_of(self)))

        def __repr__(self):
            values = ", ".join(f"{name}={getattr(self, name)!r}" for name in self.__match_args__)
            return f"{type(self).__name__}({values})"


@message(frozen=True, slots=True)
class SetFrame(Message):
    """Base of what is only a part of a message: one frame of a set."""


class FrameCode(NamedTuple):
    """How one frame of the contract is written and read.

    ``identifier`` has 0 in its lowest byte, where the sender's node-ID goes. ``says`` is the message that the frame is
    or begins, None for the frames behind the first of a set. ``unpack`` takes the sender and at least ``length`` bytes
    and gives None for a value out of its range; ``pack`` raises ``OutOfRangeError`` for one.
    """

    name: str
    identifier: int
    length: int
    pack: Callable[[Any], bytes]
    unpack: Callable[[int, bytes], Message | None]
    frame: type[Message]
    says: type[Message] | None
    senders: tuple[str, ...]
    is_device: bool
