"""All attacks by name: one place to add one."""

from typing import Final, NamedTuple

from bus_sim.attacks import frames, rights, words
from bus_sim.attacks.attack import Attack


class Entry(NamedTuple):
    """An attack: what it does, and how long it lasts where nothing else is asked for, s."""

    attack: type[Attack]
    for_s: float = 60.0

    @property
    def summary(self) -> str:
        """What it does, in one line."""
        return (self.attack.__doc__ or "").splitlines()[0]


ATTACKS: Final[dict[str, Entry]] = {
    "grant-refused": Entry(rights.GrantRefused, 120.0),
    "grant-asked": Entry(rights.GrantAsked, 120.0),
    "grant-away": Entry(rights.GrantAway),
    "claim": Entry(rights.Claim),
    "swap-cars": Entry(rights.SwapCars, 120.0),
    "bit-off": Entry(frames.BitOff, 120.0),
    "mutated": Entry(frames.Mutated, 120.0),
    "replay": Entry(frames.Replay),
    "flood": Entry(frames.Flood, 20.0),
    "stop": Entry(words.Stop, 20.0),
    "other-site": Entry(words.OtherSite),
    "newer-boot": Entry(words.NewerBoot),
    "block-all": Entry(words.BlockAll),
    "hold-all": Entry(words.HoldAll),
    "wrong-time": Entry(words.WrongTime),
    "orders": Entry(words.Orders, 120.0),
    "answers": Entry(words.WrongAnswers, 120.0),
}
