"""Heartbeats that say nothing new: a machine does nothing for them, and for every other it looks at all it knows."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import CONTRACT_VERSION, KindCode, MachineState, Reason
from onboard.contract.messages import Halted, Heartbeat, Message
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator
from onboard.core.site import Machine, Site
from onboard.holon.holon import Holon
from onboard.work.plain import NoEstimator, Plain

SITE = find_site("small")
ME, PEER, OTHER = sorted(SITE.machines)[-1], sorted(SITE.machines)[0], sorted(SITE.machines)[1]


@dataclass
class Still(Plain):
    """Counts how often it is asked to go on; ``looks``: whether it looks for something."""

    asked: int = 0
    looks: bool = False
    heard: list[Message] = field(default_factory=list)

    def advance(self, now_us: int) -> list[Effect]:
        self.asked += 1
        return []

    def watches(self, now_us: int) -> bool:
        return self.looks


class StillFactory(BehaviourFactory):
    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Still:
        return Still(fleet, KindCode.ROBOT)


class Bench:
    """One machine that has heard the same heartbeat of a peer twice."""

    def __init__(self) -> None:
        self.holon = Holon(SITE, SITE.machines[ME], StillFactory())
        assert isinstance(self.holon.behaviour, Still)
        self.still = self.holon.behaviour
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
        asked = self.still.asked
        self.holon.receive(message, self.now_us)
        self.holon.next_wake()
        return self.still.asked - asked


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
    "it was silent": lambda bench: bench.holon.mirror.peers.update(
        {PEER: replace(bench.holon.mirror.peers[PEER], heard_at_us=-60_000_000)}
    ),
    "it is an obstacle": lambda bench: bench.holon.mirror.set_aside(PEER, frozenset(), Reason.NODE_SILENT, 0),
    "it said that it halts": lambda bench: bench.holon.presence.halts.update(
        {PEER: Halted(PEER, PEER, Reason.OPERATOR, 0, False, 1)}
    ),
    "something else was heard": lambda bench: bench.holon.receive(
        replace(bench.beat, sender=OTHER, kind=SITE.machines[OTHER].kind), bench.now_us
    ),
    "something is due": lambda bench: setattr(bench, "now_us", bench.now_us + SITE.timing.heartbeat_us),
    "it looks for something": lambda bench: setattr(bench.still, "looks", True),
}


@pytest.mark.parametrize("change", CHANGES)
def test_whatever_may_be_news_asks_the_machine_to_go_on(change: str) -> None:
    bench = Bench()
    CHANGES[change](bench)
    assert bench.hear(bench.beat) > 0


def test_rights_of_another_epoch_are_no_sign_of_life_of_one_that_takes_part() -> None:
    bench = Bench()
    bench.hear(replace(bench.beat, epoch=1))
    bench.hear(replace(bench.beat, epoch=1))
    assert bench.holon.drops[Reason.OTHER_EPOCH] == 2
