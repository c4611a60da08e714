"""One fault as data: a kind of the table, and its settings, written in one line.

Faults of single frames (omission, duplicate, delay, corruption) are those of ``bus_sim.can.faults`` and keep its
settings; all others are here. Both are read by ``parse_injection``.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from bus_sim.can.faults import FaultKind, InjectedFault, parse_fault
from bus_sim.faults.table import KINDS, FaultSetting, Value
from onboard.config.problems import nearest


@dataclass(frozen=True)
class Injection:
    """A fault: its kind, and the settings that were given; those that were not have the table's defaults.

    Raises ``ValueError`` with one clear line for a kind or a setting that is not known, or that is missing.
    """

    kind: str
    given: Mapping[str, Value] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse what the table does not know."""
        settings = _settings(self.kind)
        for key in self.given:
            if key not in settings:
                remedy = nearest(key, list(settings))
                raise ValueError(f"fault {self.kind}: {key} is no setting of it; {remedy}")
        for key, setting in settings.items():
            if setting.default is None and key not in self.given:
                raise ValueError(f"fault {self.kind}: {key} is missing; give {key}={setting.wanted}")

    def __str__(self) -> str:
        """The line that ``parse_injection`` reads."""
        given = ",".join(f"{key}={value}" for key, value in self.given.items())
        return f"{self.kind}:{given}" if given else self.kind

    @property
    def target(self) -> str:
        """The machine that it strikes, by name; empty where it is none or several."""
        return self.text("target") if "target" in _settings(self.kind) else ""

    def number(self, key: str) -> float:
        """A setting that is a number. Raises ``KeyError`` for one that this kind does not have."""
        value = self._value(key)
        assert not isinstance(value, str), key
        return value

    def count(self, key: str) -> int:
        """A setting that is a whole number."""
        return round(self.number(key))

    def text(self, key: str) -> str:
        """A setting that is a word."""
        value = self._value(key)
        assert isinstance(value, str), key
        return value

    @property
    def at_us(self) -> int:
        """When it begins, us of loop time; 0 is power-up."""
        return round(self.number("at_s") * 1e6)

    @property
    def until_us(self) -> int:
        """When it ends, us of loop time."""
        return self.at_us + round(self.number("for_s") * 1e6)

    def _value(self, key: str) -> Value:
        default = _settings(self.kind)[key].default
        value = self.given.get(key, default)
        assert value is not None, key
        return value


#: Anything that ``--fault`` may name.
AnyFault = InjectedFault | Injection


def parse_injection(text: str) -> AnyFault:
    """Read ``kind:key=value,key=value``. Raises ``ValueError`` with one clear line."""
    kind, _, rest = text.strip().partition(":")
    kind = kind.strip()
    if kind in [str(one) for one in FaultKind]:
        return parse_fault(text)
    settings = _settings(kind)
    given: dict[str, Value] = {}
    for part in rest.split(",") if rest.strip() else ():
        key, equals, value = (piece.strip() for piece in part.partition("="))
        if not equals or key not in settings:
            remedy = nearest(key, list(settings))
            raise ValueError(f"fault {text!r}: {part.strip()!r} is no setting of {kind}; {remedy} (key=value)")
        if key in given:
            raise ValueError(f"fault {text!r}: {key} is given twice")
        given[key] = _read(text, key, value, settings[key])
    return Injection(kind, given)


def _read(text: str, key: str, value: str, setting: FaultSetting) -> Value:
    try:
        read = setting.reader(value)
    except ValueError:
        read = math.nan
    # Not a number, or outside its range: said the same way.
    is_wrong = not isinstance(read, str) and not setting.low <= read <= setting.high
    if is_wrong or read == "":
        raise ValueError(f"fault {text!r}: {key}={value}: must be {setting.wanted}")
    return read


def _settings(kind: str) -> Mapping[str, FaultSetting]:
    found = KINDS.get(kind)
    if found is None:
        known = [*FaultKind, *KINDS]
        raise ValueError(f"fault {kind!r}: no such kind; {nearest(kind, [str(one) for one in known])}")
    return found.settings
