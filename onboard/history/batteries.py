"""How full each machine's battery is, where a site has batteries."""

from dataclasses import dataclass

from onboard.contract.battery import BatteryLevel


@dataclass(frozen=True, slots=True)
class BatteryTold:
    """A machine tells how full its battery is; ``before`` is its word before, None for its first."""

    word: BatteryLevel
    before: BatteryLevel | None

    @property
    def is_empty_now(self) -> bool:
        """Whether it was not empty when it was heard last."""
        return self.word.charge_permille == 0 and (self.before is None or self.before.charge_permille > 0)

    @property
    def bids_changed(self) -> bool:
        """Whether the machine bids by now, or does not any more; who bids from the first says nothing new."""
        return self.word.bids is not (True if self.before is None else self.before.bids)


class Batteries:
    """A fold over levels of batteries; ``levels`` has the last word of each machine by node-ID."""

    def __init__(self) -> None:
        self.levels: dict[int, BatteryLevel] = {}

    def on_level(self, word: BatteryLevel) -> BatteryTold:
        """Take up one word, and tell it with the one before: what is news is for who shows it."""
        fact = BatteryTold(word, self.levels.get(word.sender))
        self.levels[word.sender] = word
        return fact
