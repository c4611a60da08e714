"""Words that change nothing for a machine: it does nothing for them, and for every other it looks at all it knows."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import (
    CONTRACT_VERSION,
    Grade,
    KindCode,
    LegAction,
    MachineState,
    Reason,
    Side,
    TaskPhase,
    TokenKind,
)
from onboard.contract.messages import (
    Halted,
    Heartbeat,
    Itinerary,
    Leg,
    Message,
    Progress,
    Reference,
    Stamp,
    TaskReport,
    TokenGrant,
)
from onboard.core.authority import TokenKey
from onboard.core.behaviour import NEVER_US, BehaviourFactory, Fleet, OverheardWord
from onboard.core.effects import Effect
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator
from onboard.core.site import Machine, Site
from onboard.holon.holon import Holon
from onboard.holon.schedule import Schedule
from onboard.work.plain import NoEstimator, Plain

SITE = find_site("small")
ME, PEER, OTHER = sorted(SITE.machines)[-1], sorted(SITE.machines)[0], sorted(SITE.machines)[1]


@dataclass
class Counted(Plain):
    """Counts how often it is asked to go on, and says nothing of what it waits for."""

    asked: int = 0

    def advance(self, now_us: int) -> list[Effect]:
        self.asked += 1
        return []


@dataclass
class Still(Counted):
    """Says what it waits for; ``looks``: whether it looks for something."""

    looks: bool = False
    heeded: list[Message] = field(default_factory=list)

    def looks_from(self) -> int:
        return 0 if self.looks else NEVER_US

    def heeds(self, message: OverheardWord) -> bool:
        return message in self.heeded


class StillFactory(BehaviourFactory):
    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Counted:
        return Still(fleet, KindCode.ROBOT)


@dataclass
class Choosy(Still):
    """Says of reports too which of them it reads."""

    overhears: frozenset[type[Message]] = frozenset((TaskReport,))

    def heeds(self, message: Message) -> bool:
        return message in self.heeded


class ChoosyFactory(StillFactory):
    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Choosy:
        return Choosy(fleet, KindCode.ROBOT)


class CountedFactory(StillFactory):
    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Counted:
        return Counted(fleet, KindCode.ROBOT)


class Bench:
    """One machine that has heard the same heartbeat of a peer twice."""

    def __init__(self, factory: BehaviourFactory | None = None) -> None:
        self.holon = Holon(SITE, SITE.machines[ME], factory or StillFactory())
        assert isinstance(self.holon.behaviour, Counted)
        self.counted = self.holon.behaviour
        self.now_us = 1_000_000
        self.holon.start(self.now_us)
        kind = SITE.machines[PEER].kind
        digest = self.holon.mirror.digest()
        self.beat = Heartbeat(PEER, CONTRACT_VERSION, SITE.digest, digest, 1, kind, MachineState.IDLE, 0)
        self.hear(self.beat)
        self.hear(self.beat)

    def hear(self, message: Message, after_us: int = 10_000) -> int:
        """How often the behaviour was asked to go on because of a message."""
        self.now_us += after_us
        asked = self.counted.asked
        self.holon.receive(message, self.now_us)
        self.holon.next_wake()
        return self.counted.asked - asked

    @property
    def still(self) -> Still:
        """The behaviour, one that says what it waits for."""
        assert isinstance(self.counted, Still)
        return self.counted

    def looks(self) -> None:
        """It begins to look for something."""
        self.still.looks = True
        self.marked()

    def trusts(self) -> None:
        """All have answered: its rights count."""
        self.holon.tokens.trust()
        self.marked()

    def marked(self, _done: object = None) -> None:
        """What was done to this machine's state was marked by the event that did it."""
        self.holon.schedule.changed()
        self.holon.next_wake()


def test_a_heartbeat_that_says_nothing_new_asks_nobody_to_go_on_and_is_a_sign_of_life() -> None:
    bench = Bench()
    due_us = bench.holon.next_wake()
    assert bench.hear(bench.beat) == 0
    assert bench.holon.mirror.peers[PEER].heard_at_us == bench.holon.time.clock.bus_us(bench.now_us)
    assert bench.holon.next_wake() == due_us


CHANGES: dict[str, Callable[[Bench], object]] = {
    "another state": lambda bench: setattr(bench, "beat", replace(bench.beat, state=MachineState.WORKING)),
    "another life": lambda bench: setattr(bench, "beat", replace(bench.beat, boot=2)),
    "another mirror": lambda bench: setattr(bench, "beat", replace(bench.beat, mirror_digest=4711)),
    "it was silent": lambda bench: setattr(bench.holon.mirror.peers[PEER], "heard_at_us", -60_000_000),
    "it is an obstacle": lambda bench: bench.marked(
        bench.holon.mirror.set_aside(PEER, frozenset(), Reason.NODE_SILENT, 0)
    ),
    "it said that it halts": lambda bench: bench.marked(
        bench.holon.presence.halts.update({PEER: Halted(PEER, PEER, Reason.OPERATOR, 0, False, 1)})
    ),
    "something else was heard": lambda bench: bench.holon.receive(
        replace(bench.beat, sender=OTHER, kind=SITE.machines[OTHER].kind), bench.now_us
    ),
    "something is due": lambda bench: setattr(bench, "now_us", bench.now_us + SITE.timing.heartbeat_us),
    "it looks for something": lambda bench: bench.looks(),
}


@pytest.mark.parametrize("change", CHANGES)
def test_whatever_may_be_news_asks_the_machine_to_go_on(change: str) -> None:
    bench = Bench()
    CHANGES[change](bench)
    assert bench.hear(bench.beat) > 0


def new_plan(bench: Bench) -> None:
    """All hear of a plan, so that all mirrors are others than before, and the peer's next heartbeat says so."""
    stamp = Stamp(1, OTHER, 0)
    bench.hear(Itinerary(OTHER, 1, Grade.FIRM, stamp, (Leg(LegAction.STAND, 1, 1, 1, Side.NEAR, 1),)))
    bench.beat = replace(bench.beat, mirror_digest=bench.holon.mirror.digest())


def test_a_heartbeat_of_a_mirror_that_has_changed_as_mine_has_asks_nobody_to_go_on() -> None:
    bench = Bench()
    new_plan(bench)
    assert bench.hear(bench.beat) == 0
    assert bench.holon.mirror.peers[PEER].mirror_digest == bench.beat.mirror_digest
    assert bench.holon.mirror.peers[PEER].heard_at_us == bench.holon.time.clock.bus_us(bench.now_us)


def test_one_whose_mirror_was_compared_with_mine_is_news_when_it_is_equal_again() -> None:
    bench = Bench()
    bench.hear(replace(bench.beat, mirror_digest=4711))
    bench.marked()
    assert bench.hear(bench.beat) > 0
    assert bench.hear(bench.beat) == 0


def test_a_behaviour_that_says_nothing_of_what_it_waits_for_hears_of_each_new_mirror() -> None:
    bench = Bench(CountedFactory())
    new_plan(bench)
    assert bench.hear(bench.beat) > 0


def test_a_machine_that_says_again_what_it_said_before_another_word_is_believed() -> None:
    bench = Bench()
    bench.hear(replace(bench.beat, state=MachineState.WORKING))
    assert bench.hear(bench.beat) > 0
    assert bench.holon.mirror.peers[PEER].state is MachineState.IDLE


def test_rights_of_another_epoch_are_no_sign_of_life_of_one_that_takes_part() -> None:
    bench = Bench()
    bench.hear(replace(bench.beat, epoch=1))
    bench.hear(replace(bench.beat, epoch=1))
    assert bench.holon.drops[Reason.OTHER_EPOCH] == 2


# --- words about others' rights and places ---------------------------------------------------------------------------

SLOT = next(iter(sorted(SITE.stewards)))
AWAY = TokenGrant(PEER, TokenKind.SEGMENT, SLOT << 8 | 1, 1, OTHER)
MINE = TokenGrant(PEER, TokenKind.SEGMENT, SLOT << 8 | 1, 1, ME)
THERE = Progress(OTHER, 1, 0, SLOT, 1, 0, 0)


@pytest.mark.parametrize("word", [AWAY, THERE], ids=["a right of others", "a place of another"])
def test_what_is_none_of_its_business_asks_nobody_to_go_on_and_is_believed(word: Message) -> None:
    bench = Bench()
    bench.marked()
    assert bench.hear(word) == 0
    if word is AWAY:
        assert bench.holon.tokens.beliefs.of(TokenKey(AWAY.token_kind, AWAY.token)).holder == OTHER
    else:
        assert bench.holon.mirror.progress[OTHER] == THERE


HEEDED: dict[str, Callable[[Bench], object]] = {
    "it reads that": lambda bench: bench.still.heeded.append(AWAY),
    "it looks for something": lambda bench: bench.looks(),
    "its sender is an obstacle": lambda bench: bench.marked(
        bench.holon.mirror.set_aside(PEER, frozenset(), Reason.NODE_SILENT, 0)
    ),
    "it gets the right": lambda bench: bench.trusts(),
    "something else was heard": CHANGES["something else was heard"],
    "something is due": CHANGES["something is due"],
}


@pytest.mark.parametrize("reason", HEEDED)
def test_whatever_it_may_be_about_asks_the_machine_to_go_on(reason: str) -> None:
    bench = Bench()
    bench.marked()
    HEEDED[reason](bench)
    assert bench.hear(MINE if reason == "it gets the right" else AWAY) > 0


def test_a_word_of_its_system_asks_only_who_waits_for_it_to_go_on() -> None:
    report = TaskReport(PEER, Reference(PEER, 1), TaskPhase.AWARDED, 0, Reason.NONE)
    plain, choosy, waiting = Bench(), Bench(ChoosyFactory()), Bench(ChoosyFactory())
    waiting.still.heeded.append(report)
    for bench in (plain, choosy, waiting):
        bench.marked()
    assert (plain.hear(report) > 0, choosy.hear(report), waiting.hear(report) > 0) == (True, 0, True)


def test_a_machine_that_sweeps_goes_on_after_every_word(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Schedule, "sweeps", True)
    bench = Bench()
    bench.marked()
    assert (bench.hear(bench.beat) > 0, bench.hear(AWAY) > 0, bench.hear(THERE) > 0) == (True, True, True)
