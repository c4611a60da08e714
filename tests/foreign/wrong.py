"""Frames that do not count, why, and who is told so (duties F2 and F3 of docs/protocol.md)."""

from dataclasses import dataclass, field

from tests.foreign.words import Signals, by_number

_TOOLS = range(251, 256)
_STOP = "EmergencyStop"


def fault_of(nodes: tuple[int, ...], me: int, number: int, data: bytes) -> str:
    """Why a frame of the fleet bus does not count; empty where it does. All others of an alley are compartments."""
    message, sender = by_number("fleet").get(number & ~0xFF), number & 0xFF
    if message is None or not sender:
        return "UNKNOWN_IDENTIFIER"
    if len(data) < message.length:
        return "SHORT_FRAME"
    raw = message.decode(data, decode_choices=False)
    assert isinstance(raw, dict)
    for signal in message.signals:
        value = raw[signal.name]
        low, high = signal.minimum, signal.maximum
        is_named = not signal.choices or value in signal.choices
        assert isinstance(value, int | float)
        if not is_named or (low is not None and value < low) or (high is not None and value > high):
            return "VALUE_OUT_OF_RANGE"
    if message.name == _STOP:
        return ""
    if sender not in nodes and sender not in _TOOLS:
        return "NOT_OF_SITE"
    kind = "Gateway" if sender in _TOOLS else "Robot" if sender == me else "Compartment"
    return "" if kind in message.senders else "NOT_OF_KIND"


@dataclass
class Drops:
    """How many of each, and what was told of them last. Times in us."""

    counts: dict[str, int] = field(default_factory=dict)
    told: dict[str, tuple[int, int]] = field(default_factory=dict)

    def add(self, reason: str) -> None:
        """One more."""
        self.counts[reason] = self.counts.get(reason, 0) + 1

    def due(self, beat_us: int, now_us: int) -> list[tuple[str, Signals]]:
        """What is to be told by now: what has grown, once in a heartbeat period for each reason."""
        found: list[tuple[str, Signals]] = []
        for reason, count in self.counts.items():
            told, said_us = self.told.get(reason, (0, now_us - beat_us))
            if count != told and now_us >= said_us + beat_us:
                self.told[reason] = count, now_us
                found.append(("Diagnostic", {"reason": reason, "count": count}))
        return found

    def next_due(self, beat_us: int) -> int | None:
        """When something is to be told."""
        late = [said_us + beat_us for reason, (told, said_us) in self.told.items() if self.counts[reason] != told]
        return min(late, default=None)


@dataclass
class Stops:
    """Emergency stops that hold a robot (duties H1, H2). Times in us."""

    since_us: dict[int, int] = field(default_factory=dict)
    listens_until_us: int = 0

    def is_held(self, now_us: int) -> bool:
        """Whether it stands, or listens still before it goes on."""
        for sender in [one for one, us in self.since_us.items() if now_us >= us + 30_000_000]:
            self._lift(sender, now_us)
        return bool(self.since_us) or now_us < self.listens_until_us

    def go(self, stopper: int, now_us: int) -> None:
        """An operator lifts the stop of one, or all (0)."""
        for sender in [one for one in self.since_us if stopper in (0, one)]:
            self._lift(sender, now_us)

    def _lift(self, sender: int, now_us: int) -> None:
        del self.since_us[sender]
        if not self.since_us:
            self.listens_until_us = now_us + 2_000_000
