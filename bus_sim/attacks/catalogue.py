"""All attacks by name: one place to add one."""

from typing import Final, NamedTuple

from bus_sim.attacks import frames, rights, words
from bus_sim.attacks.attack import Attack


class CatalogueEntry(NamedTuple):
    """An attack: what it does, and how long it lasts where nothing else is asked for, s."""

    attack: type[Attack]
    for_s: float = 60.0

    @property
    def summary(self) -> str:
        """What it does, in one line."""
        return (self.attack.__doc__ or "").splitlines()[0]


ATTACKS: Final[dict[str, CatalogueEntry]] = {
    "grant-refused": CatalogueEntry(rights.GrantRefused, 120.0),
    "grant-asked": CatalogueEntry(rights.GrantAsked, 120.0),
    "grant-away": CatalogueEntry(rights.GrantAway),
    "claim": CatalogueEntry(rights.FalseClaim),
    "swap-cars": CatalogueEntry(rights.SwapCars, 120.0),
    "bit-off": CatalogueEntry(frames.BitOff, 120.0),
    "mutated": CatalogueEntry(frames.Mutated, 120.0),
    "replay": CatalogueEntry(frames.Replay),
    "flood": CatalogueEntry(frames.Flood, 20.0),
    "stop": CatalogueEntry(words.ForgedStop, 20.0),
    "other-site": CatalogueEntry(words.OtherSite),
    "newer-boot": CatalogueEntry(words.NewerBoot),
    "block-all": CatalogueEntry(words.BlockAll),
    "hold-all": CatalogueEntry(words.HoldAll),
    "wrong-time": CatalogueEntry(words.WrongTime),
    "orders": CatalogueEntry(words.ForgedOrders, 120.0),
    "answers": CatalogueEntry(words.WrongAnswers, 120.0),
}
