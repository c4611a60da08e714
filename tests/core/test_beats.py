"""Heartbeats that are said out of their turn: not too close to the last, and without drops that were told just now."""

from itertools import pairwise

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import CONTRACT_VERSION, KindCode, MachineState, Reason
from onboard.contract.messages import Diagnostic, Heartbeat, Message
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Send
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator
from onboard.core.site import BEATS_APART_US, Machine, Site
from onboard.holon.holon import Holon
from onboard.work.plain import NoEstimator, Plain

SITE = find_site("small")
#: It knows bus time by itself; the others are heard.
NODE, *OTHERS = sorted(SITE.machines)
BEAT_US = SITE.timing.heartbeat_us
#: Two others fall silent, and come back so much later, 10 ms apart, amid a period of the node.
BACK_US = 10 * BEAT_US + BEAT_US // 2


class PlainFactory(BehaviourFactory):
    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Plain:
        return Plain(fleet, KindCode.COMPARTMENT, MachineState.IDLE)


class Life:
    """One machine that takes part, and what it said, by the time, us."""

    def __init__(self) -> None:
        self.holon = Holon(SITE, SITE.machines[NODE], PlainFactory())
        self.said: list[tuple[int, Message]] = []
        self.now_us = 0
        self.note(self.holon.start(0))

    def note(self, effects: list[Effect]) -> None:
        self.said += [(self.now_us, one.message) for one in effects if isinstance(one, Send)]

    def hears(self, when_us: int, message: Message) -> None:
        while (due_us := self.holon.next_wake()) is not None and due_us <= when_us:
            self.now_us = max(due_us, self.now_us)
            self.note(self.holon.wake(self.now_us))
        self.now_us = when_us
        self.note(self.holon.receive(message, when_us))

    def times(self, kind: type[Message]) -> list[int]:
        return [when_us for when_us, message in self.said if isinstance(message, kind)]


def beat(node: int) -> Heartbeat:
    kind = SITE.machines[node].kind if node in SITE.machines else KindCode.ROBOT
    return Heartbeat(node, CONTRACT_VERSION, SITE.digest, 0xFFFF, 1, kind, MachineState.IDLE, 0)


@pytest.fixture
def life() -> Life:
    """Another is heard all the time, a stranger too; two come back."""
    life = Life()
    returning, steady, stranger = OTHERS[:2], OTHERS[2], 200
    back = {BACK_US: returning[0], BACK_US + 10_000: returning[1]}
    words = [(when_us, node) for when_us in range(100_000, 20 * BEAT_US, 100_000) for node in (steady, stranger)]
    words += [(when_us + 100_000 * number, node) for when_us in (150_000,) for number, node in enumerate(returning)]
    for when_us, node in sorted([*words, *back.items()]):
        life.hears(when_us, beat(node))
    return life


def test_who_hears_two_come_back_says_one_heartbeat_soon(life: Life) -> None:
    beats = life.times(Heartbeat)
    assert any(BACK_US <= when_us < BACK_US + BEAT_US // 4 for when_us in beats)
    assert min(b - a for a, b in pairwise(beats)) >= BEATS_APART_US


def test_drops_are_told_once_in_a_period(life: Life) -> None:
    told = [
        when_us for when_us, word in life.said if isinstance(word, Diagnostic) and word.reason is Reason.NOT_OF_SITE
    ]
    assert len(told) > 5
    assert min(b - a for a, b in pairwise(told)) >= BEAT_US
