"""A machine that stands with a car is told as such: on the bus by the lowest live machine, and by status."""

from bus_sim.sites import find_site
from onboard.contract.codes import MachineState, Reason
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import CarAt, Halted, Reference
from onboard.core.authority import TokenBook
from onboard.core.mirror import Peer
from onboard.core.site import Segment
from onboard.holon.presence import Presence
from onboard.operate.park import Park
from onboard.operate.words import state_words
from onboard.systems.car_park.site import car_park
from onboard.ways.mirror import WayMirror
from tests.operate.hand import beat

SITE = car_park(find_site("small"))
ME = min(SITE.machines)
ROBOT = next(node for node, machine in SITE.machines.items() if machine.name == "MR1")
NOW_US = 30_000_000


def presence(*, with_car: bool) -> Presence:
    mirror, tokens = WayMirror(SITE, ME), TokenBook(SITE, ME)
    mirror.peers[ROBOT] = Peer(SITE.machines[ROBOT].kind, MachineState.WORKING, 3, 0, NOW_US, 0, 0, NOW_US)
    mirror.set_aside(ROBOT, frozenset({Segment(1, 3)}), Reason.FALSE_STATEMENT, NOW_US)
    if with_car:
        mirror.on_car(CarAt(ROBOT, Reference(ME, 4), ANY_STATION, 2, 2700))
    return Presence(SITE, ME, mirror, tokens)


def test_a_machine_that_stands_with_a_car_is_said_to_need_a_person() -> None:
    assert presence(with_car=True).halted_ones(NOW_US) == [
        Halted(ME, ROBOT, Reason.FALSE_STATEMENT, 0, True, 3),
    ]
    assert presence(with_car=False).halted_ones(NOW_US) == [], "its task goes to another"


def test_status_tells_who_it_is_and_what_to_do() -> None:
    park = Park(SITE)
    park.feed(beat(ROBOT, MachineState.WORKING), NOW_US)
    park.feed(Halted(ME, ROBOT, Reason.FALSE_STATEMENT, 0, True, 3), NOW_US)
    told = state_words(park, ROBOT, NOW_US)
    assert told.startswith("stands: false statement (said by ")
    assert "needs a person: it says that it goes and stands" in told
