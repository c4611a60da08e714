"""All attacks by name: one place to add one."""

from typing import Final, NamedTuple

from bus_sim.attacks import frames, lives, rights, seals, words, work
from bus_sim.attacks.attack import Attack

#: Right words for what a node said that may not: it is not of the site, or proves nothing.
_SAID: Final = frozenset({"NOT_OF_SITE", "UNSEALED"})
#: For seals that are no good.
_SEALED: Final = _SAID | {"FALSE_SEAL"}
#: For what was said once already.
_AGAIN: Final = _SEALED | {"REPLAYED"}
_STOP: Final = frozenset({"EMERGENCY_STOP"})


class CatalogueEntry(NamedTuple):
    """An attack: what it does, how long it lasts where nothing else is asked for, s, and the right words for it.

    ``fills_bus``: nobody can say a word before it is over. ``as_others``: it speaks under numbers of the site's
    machines, whoever the attacker is.
    """

    attack: type[Attack]
    for_s: float = 60.0
    names: frozenset[str] = _SAID
    fills_bus: bool = False
    as_others: bool = False

    @property
    def summary(self) -> str:
        """What it does, in one line."""
        return (self.attack.__doc__ or "").splitlines()[0]


ATTACKS: Final[dict[str, CatalogueEntry]] = {
    "grant-refused": CatalogueEntry(rights.GrantRefused, 120.0),
    "grant-asked": CatalogueEntry(rights.GrantAsked, 120.0),
    "grant-away": CatalogueEntry(rights.GrantAway),
    "grant-as-holder": CatalogueEntry(rights.GrantAsHolder, 120.0, as_others=True),
    "claim": CatalogueEntry(rights.FalseClaim),
    "claim-as-taker": CatalogueEntry(rights.ClaimAsTaker, as_others=True),
    "statements": CatalogueEntry(rights.Statements),
    "regeneration": CatalogueEntry(rights.ForgedRegeneration),
    "swap-cars": CatalogueEntry(rights.SwapCars, 120.0),
    "bit-off": CatalogueEntry(frames.BitOff, 120.0, _AGAIN),
    "bit-off-as-sender": CatalogueEntry(frames.BitOffAsSender, 60.0, _AGAIN, as_others=True),
    "echo": CatalogueEntry(frames.Echo, names=_AGAIN),
    "mutated": CatalogueEntry(frames.Mutated, 120.0, _AGAIN | {"UNKNOWN_IDENTIFIER"}),
    "shortened": CatalogueEntry(frames.Shortened, 60.0, frozenset({"SHORT_FRAME"})),
    "readdressed": CatalogueEntry(frames.Readdressed, 60.0, _AGAIN, as_others=True),
    "random": CatalogueEntry(frames.RandomFrames, 60.0, frozenset({"UNKNOWN_IDENTIFIER"})),
    "replay": CatalogueEntry(frames.Replay, names=_AGAIN),
    "replay-recorded": CatalogueEntry(frames.Recorded, 60.0, _AGAIN, as_others=True),
    "flood": CatalogueEntry(frames.Flood, 20.0, frozenset({"UNKNOWN_IDENTIFIER"}), fills_bus=True),
    "flood-known": CatalogueEntry(frames.FloodKnown, 20.0, fills_bus=True),
    "stop": CatalogueEntry(words.ForgedStop, 20.0, _STOP),
    "stop-as-all": CatalogueEntry(lives.StopsAsAll, 20.0, _STOP, as_others=True),
    "stop-and-go": CatalogueEntry(lives.StopAndGo, 20.0, _STOP),
    "halts": CatalogueEntry(lives.ForgedHalts),
    "beats": CatalogueEntry(lives.ForgedBeats),
    "beats-as-all": CatalogueEntry(lives.BeatsAsAll, as_others=True),
    "own-number": CatalogueEntry(lives.OwnNumbers, as_others=True),
    "other-site": CatalogueEntry(words.OtherSite),
    "newer-boot": CatalogueEntry(words.NewerBoot),
    "block-all": CatalogueEntry(words.BlockAll),
    "hold-all": CatalogueEntry(words.HoldAll),
    "wrong-time": CatalogueEntry(words.WrongTime),
    "time-as-source": CatalogueEntry(lives.TimeAsSource, as_others=True),
    "bids": CatalogueEntry(work.CheapestBids),
    "calls": CatalogueEntry(work.ForgedCalls),
    "awards-as-caller": CatalogueEntry(work.AwardsAsCaller, as_others=True),
    "reports": CatalogueEntry(work.FalseReports),
    "plans": CatalogueEntry(work.FalsePlans),
    "orders": CatalogueEntry(words.ForgedOrders, 120.0),
    "answers": CatalogueEntry(words.WrongAnswers, 120.0),
    "seals-alone": CatalogueEntry(seals.BareSeals, 60.0, _SEALED),
    "seals-guessed": CatalogueEntry(seals.GuessedSeals, 60.0, _SEALED),
    "seals-split": CatalogueEntry(seals.SplitSeals, 60.0, _SEALED, as_others=True),
    "challenges": CatalogueEntry(seals.ManyChallenges, 60.0, _SEALED),
    "false-answers": CatalogueEntry(seals.FalseAnswers, 60.0, _SEALED),
    "false-alarms": CatalogueEntry(seals.FalseAlarms),
}
