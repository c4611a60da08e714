"""A person in the loop (row M38): a vehicle is held, carries out one elementary action at a time, or is let go again.

Held, it begins nothing, asks for no right and bids for nothing; what its drive or handler is about is ended. A step by
hand is the next one of its plan, and it too needs its rights: a person's order permits nothing by itself.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from onboard.core.effects import Effect, Record, Send
from onboard.kinds.terminal.messages import ManualMode, ManualOrder, ManualState
from onboard.kinds.terminal.traffic import Owned


@dataclass
class Manual:
    """One vehicle's mode. ``by`` and ``number`` are the last order's desk and number.

    ``allowed`` are plan version and step of a step by hand.
    """

    node_id: int
    mode: ManualMode = ManualMode.AUTOMATIC
    number: int = 0
    by: int = 0
    allowed: tuple[int, int] | None = None

    def replay(self, entries: Iterable[Mapping[str, str | int]]) -> None:
        """After a restart the vehicle is held if it was; a step by hand is not begun anew."""
        for entry in entries:
            if entry.get("record") == "manual":
                self.mode = ManualMode(int(entry["mode"]))
                self.number, self.by = int(entry["number"]), int(entry["by"])
        if self.mode is ManualMode.STEP:
            self.mode = ManualMode.HELD

    def ordered(self, order: ManualOrder, owned: Owned | None) -> list[Effect]:
        """A person's order; said again it is only answered again."""
        if (order.sender, order.number) == (self.by, self.number):
            return [self.told()]
        self.mode, self.by, self.number = order.manual_mode, order.sender, order.number
        step = order.manual_mode is ManualMode.STEP and owned is not None
        self.allowed = (owned.plan.version, owned.current) if step and owned is not None else None
        entry: dict[str, str | int] = {"record": "manual", "mode": int(self.mode), "by": self.by, "number": self.number}
        return [Record(entry), self.told()]

    def may_begin(self, owned: Owned) -> bool:
        """Whether something may be begun for the step in hand; a step by hand that is over holds the vehicle again."""
        if self.mode is ManualMode.AUTOMATIC:
            return True
        return self.mode is ManualMode.STEP and self.allowed == (owned.plan.version, owned.current)

    @property
    def is_automatic(self) -> bool:
        """Whether nobody has a hand in."""
        return self.mode is ManualMode.AUTOMATIC

    def told(self) -> Effect:
        """What the vehicle says of it."""
        return Send(ManualState(self.node_id, self.number, self.mode))
