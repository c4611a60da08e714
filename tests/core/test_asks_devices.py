"""A holon that begins a life asks its devices how they stand, and again every second for as long as it starts."""

from collections.abc import Callable, Iterable

from bus_sim.sites import find_site
from onboard.contract.codes import KindCode, MachineState
from onboard.contract.messages import BusTime, Message, StateRequest
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Tell
from onboard.core.journal_state import INTACT, JournalCondition, JournalState
from onboard.core.mirror import Mirror
from onboard.core.negotiation import Estimator
from onboard.core.site import Machine, Site
from onboard.holon.fixed_times import ASK_AGAIN_US
from onboard.holon.holon import Holon
from onboard.work.plain import NoEstimator, Plain

SITE = find_site("small")
#: The source of bus time knows it at once, a robot hears it.
SOURCE, ROBOT = sorted(SITE.machines)[0], sorted(SITE.machines)[-1]
BEGIN_US = 1_000_000


class Sensing(Plain):
    """It starts until the first word of a device."""

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        self.state = MachineState.IDLE
        return []


class SensingFactory(BehaviourFactory):
    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Sensing:
        return Sensing(fleet, KindCode.ROBOT, MachineState.STARTING)


class Life:
    """One life of a machine, and when it asked its devices, us after its begin."""

    def __init__(self, node: int, journal: JournalCondition = INTACT) -> None:
        self.holon = Holon(SITE, SITE.machines[node], SensingFactory(), journal=journal)
        self.now_us = BEGIN_US
        self.asked_us: list[int] = []
        self.note(self.holon.start(BEGIN_US))

    def note(self, effects: Iterable[Effect]) -> None:
        wanted = Tell(StateRequest(self.holon.node_id))
        self.asked_us += [self.now_us - BEGIN_US for effect in effects if effect == wanted]

    def at(self, after_us: int, happens: Callable[[int], list[Effect]] = lambda _: []) -> None:
        """Let time pass until so long after the begin; then something happens."""
        while (due_us := self.holon.next_wake()) is not None and due_us <= BEGIN_US + after_us:
            self.now_us = max(due_us, self.now_us)
            self.note(self.holon.wake(self.now_us))
        self.now_us = BEGIN_US + after_us
        self.note(happens(self.now_us))

    def device_speaks(self, now_us: int) -> list[Effect]:
        return self.holon.sense(StateRequest(self.holon.node_id), now_us)


def test_it_asks_at_once_and_every_second_until_its_devices_were_heard() -> None:
    life = Life(SOURCE)
    life.at(2_500_000, life.device_speaks)
    life.at(10_000_000)
    assert life.asked_us == [0, ASK_AGAIN_US, 2 * ASK_AGAIN_US]


def test_it_does_not_ask_before_what_they_say_is_heard_in_the_time_of_the_bus() -> None:
    life = Life(ROBOT)
    life.at(300_000, life.device_speaks)
    life.at(600_000, lambda now_us: life.holon.receive(BusTime(SOURCE, 77_000_000), now_us))
    life.at(700_000)
    assert life.asked_us == [600_000]
    life.at(10_000_000)
    assert life.asked_us == [600_000], "what was said before counts where nobody answers"


def test_a_machine_that_hears_no_device_asks_none() -> None:
    life = Life(SOURCE, JournalCondition(JournalState.FOREIGN))
    life.at(5_000_000)
    assert life.asked_us == []
