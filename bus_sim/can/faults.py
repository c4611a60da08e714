"""Faults of a CAN bus as data: seeded, named, written in one line, and applied the same way in every run.

Inconsistent omissions and duplicates are real on CAN (Rufino, Verissimo, Arroz, Almeida, Rodrigues: Fault-tolerant
broadcasts in CAN, FTCS 1998) and more often come from a receiver's queue; corruption is what makes error frames.
"""

import random
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from enum import StrEnum
from typing import Final

from onboard.core.frame import CAN_EFF_MASK, Frame


class FaultKind(StrEnum):
    """What a fault does to a frame that it strikes."""

    OMISSION = "omission"
    DUPLICATE = "duplicate"
    DELAY = "delay"
    CORRUPTION = "corruption"


@dataclass(frozen=True, slots=True)
class InjectedFault:
    """One fault.

    *omission*: the chosen receivers do not hear the frame, everybody else does, nobody notices. *duplicate*: they hear
    it twice, the second time ``delay_us`` later. *delay*: they hear it ``delay_us`` late, perhaps after later frames.
    *corruption*: a bit is flipped on the wire for all, the frame is destroyed by an error flag and sent again; with
    ``receivers``, only these see a wrong CRC: an error-active one destroys the frame, an error-passive one misses it.

    ``receivers`` are node-IDs or names, none meaning all. A frame matches where ``frame.arbitration_id & id_mask ==
    id_value & id_mask``, the format is right (``extended``, None for both) and ``from_us <= time_us < until_us``. With
    ``nth`` exactly the n-th matching frame is struck (from 1; a retransmission counts again); else each matching
    frame with ``probability``, drawn for each receiver apart. Each fault draws from a generator of its own, ``seed``.

    Raises ``ValueError`` with one clear line for values that make no sense.
    """

    kind: FaultKind
    name: str = ""
    receivers: tuple[str, ...] = ()
    probability: float = 1.0
    nth: int | None = None
    id_value: int = 0
    id_mask: int = 0
    extended: bool | None = None
    from_us: int = 0
    until_us: int | None = None
    delay_us: int = 0
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what makes no sense."""
        problem = self._problem()
        if problem:
            raise ValueError(f"fault {self.name or self.kind.value}: {problem}")

    def _problem(self) -> str | None:
        if not 0.0 <= self.probability <= 1.0:
            return f"probability={self.probability}: must be 0 to 1"
        if self.nth is not None and self.nth < 1:
            return f"nth={self.nth}: frames are counted from 1"
        if self.nth is not None and self.probability != 1.0:
            return "nth and probability exclude each other: give one of them"
        if self.from_us < 0 or (self.until_us is not None and self.until_us <= self.from_us):
            return f"window from_us={self.from_us} until_us={self.until_us}: must begin at 0 or later and not be empty"
        if self.kind is FaultKind.DELAY and self.delay_us < 1:
            return "delay_us is missing: by how many microseconds is the frame late?"
        if self.kind in (FaultKind.OMISSION, FaultKind.CORRUPTION) and self.delay_us:
            return f"delay_us={self.delay_us}: an {self.kind.value} has no delay; use delay or duplicate"
        return "delay_us must not be negative" if self.delay_us < 0 else None

    def __str__(self) -> str:
        """The line that ``parse_fault`` reads."""
        settings = [f"{key}={value}" for key, value in self._settings().items() if value is not None]
        return f"{self.kind.value}:{','.join(settings)}" if settings else self.kind.value

    def _settings(self) -> dict[str, str | None]:
        changed = {
            f.name: getattr(self, f.name)
            for f in fields(self)
            if f.default is not MISSING and getattr(self, f.name) != f.default
        }
        changed.pop("id_value", None)
        mask = changed.pop("id_mask", None)
        extended = changed.pop("extended", None)
        receivers = changed.pop("receivers", None)
        return {
            "name": changed.pop("name", None),
            "receivers": "|".join(receivers) if receivers else None,
            "id": None if mask is None else f"0x{self.id_value:X}:0x{mask:X}",
            "format": None if extended is None else _FORMAT_NAMES[extended],
            **{key: str(value) for key, value in changed.items()},
        }


_FORMATS: Final[dict[str, bool | None]] = {"standard": False, "extended": True, "any": None}
_FORMAT_NAMES: Final = {value: name for name, value in _FORMATS.items()}


def _whole(text: str) -> int:
    return int(text, 0)


def _receivers(text: str) -> tuple[str, ...]:
    receivers = tuple(text.split("|"))
    if not all(receivers):
        raise ValueError
    return receivers


def _format(text: str) -> bool | None:
    if text not in _FORMATS:
        raise ValueError
    return _FORMATS[text]


_READERS: Final[dict[str, tuple[Callable[[str], object], str]]] = {
    "name": (str, "a word"),
    "receivers": (_receivers, "node-IDs or names joined by |, such as 3|4"),
    "probability": (float, "a number from 0 to 1"),
    "nth": (_whole, "a whole number from 1"),
    "format": (_format, "standard, extended or any"),
    "from_us": (_whole, "whole microseconds"),
    "until_us": (_whole, "whole microseconds"),
    "delay_us": (_whole, "whole microseconds"),
    "seed": (_whole, "a whole number"),
}
_KEYS: Final = ("id", *_READERS)


def parse_fault(text: str) -> InjectedFault:
    """Read one fault from ``kind:key=value,key=value``.

    Such as ``omission:receivers=3|4,probability=0.01,id=0x100:0x7F0,seed=7``. Keys: those of ``InjectedFault``, with
    ``id=VALUE[:MASK]`` (no mask: exactly this identifier) and ``format=standard|extended|any``. Raises ``ValueError``.
    """
    kind_text, _, settings = text.strip().partition(":")
    try:
        kind = FaultKind(kind_text.strip())
    except ValueError:
        kinds = ", ".join(FaultKind)
        raise ValueError(f"fault {text!r}: {kind_text.strip()!r} is no kind of fault; known are {kinds}") from None
    values: dict[str, object] = {}
    for part in settings.split(",") if settings.strip() else ():
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or key not in _KEYS:
            raise ValueError(
                f"fault {text!r}: {part.strip()!r} is no setting; known are {', '.join(_KEYS)} (key=value)"
            )
        if key in values or (key == "id" and "id_mask" in values):
            raise ValueError(f"fault {text!r}: {key} is given twice")
        values |= _read_id(text, value) if key == "id" else {_field(key): _read(text, key, value)}
    return InjectedFault(kind, **values)  # type: ignore[arg-type]  # each reader answers its field's type


def _field(key: str) -> str:
    return "extended" if key == "format" else key


def _read(text: str, key: str, value: str) -> object:
    reader, wanted = _READERS[key]
    try:
        return reader(value)
    except ValueError:
        raise ValueError(f"fault {text!r}: {key}={value}: must be {wanted}") from None


def _read_id(text: str, value: str) -> dict[str, object]:
    number, colon, mask = value.partition(":")
    try:
        id_value, id_mask = _whole(number), _whole(mask) if colon else CAN_EFF_MASK
    except ValueError:
        id_value = id_mask = -1
    if not (0 <= id_value <= CAN_EFF_MASK and 0 <= id_mask <= CAN_EFF_MASK):
        raise ValueError(
            f"fault {text!r}: id={value}: must be VALUE or VALUE:MASK, hexadecimal with 0x, up to 0x{CAN_EFF_MASK:X}"
        )
    return {"id_value": id_value, "id_mask": id_mask}


class FaultInjector:
    """A fault at work: its generator, how many frames matched and how often it struck."""

    def __init__(self, fault: InjectedFault) -> None:
        self.fault = fault
        self.matched = 0
        self.struck = 0
        self._random = random.Random(fault.seed)
        self._receivers = frozenset(fault.receivers)
        self._wanted_id = fault.id_value & fault.id_mask

    def is_at_work(self, time_us: int) -> bool:
        """Whether frames that start at ``time_us`` may be struck."""
        fault = self.fault
        return fault.from_us <= time_us and (fault.until_us is None or time_us < fault.until_us)

    def concerns(self, frame: Frame, time_us: int) -> bool:
        """Whether this frame may be struck; to be asked once for each frame, as matches are counted."""
        fault = self.fault
        if frame.arbitration_id & fault.id_mask != self._wanted_id or not self.is_at_work(time_us):
            return False
        if fault.extended is not None and frame.is_extended is not fault.extended:
            return False
        self.matched += 1
        return fault.nth is None or self.matched == fault.nth

    def chooses(self, name: str, node_id: int | None) -> bool:
        """Whether a node is among the receivers."""
        return not self._receivers or name in self._receivers or str(node_id) in self._receivers

    def strikes(self) -> bool:
        """Draw whether it happens this time."""
        hit = self.fault.probability >= 1.0 or self._random.random() < self.fault.probability
        self.struck += hit
        return hit

    def pick_bit(self, bits: int) -> int:
        """Draw which of ``bits`` wire bits is flipped, SOF excepted: 1 to ``bits`` - 1."""
        return self._random.randrange(1, bits)
