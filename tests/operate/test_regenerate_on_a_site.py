"""The bar of a lost journal: after the operator's command every site serves again within five minutes."""

import pytest

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import DeskText, Reason, RegenerationPhase, TaskPhase
from onboard.contract.constants import OUTSIDE
from onboard.contract.messages import CarAt, DeskOrder, Halted, Heartbeat, Regeneration, TaskReport
from onboard.core.site import Site
from tests.sites import at_arrival, at_the_key
from tests.system.scene import Scene, play, stays
from tests.thinned import some

SITE = at_the_key(find_site("small"))
AGAIN = DeskText.INSERT_AGAIN
CARS = stays((0, 320), (60, 380), (120, 440), (300, None))
#: A machine loses its journal, and when; its person comes 20 s later and sees where it stands.
LOSSES = [("MR1", 50, "p(1;5)"), ("MR2", 20, "p(3;8)"), ("IOC1", 50, ""), ("IOC1", 190, ""), ("ER1", 50, "")]


def played(*faults: str, site: Site = SITE) -> Scene:
    def plant(simulation: Simulation) -> None:
        arm(simulation, [parse_injection(fault) for fault in faults])

    return play(site, CARS, plant=plant, limit_s=1_500)


@pytest.mark.parametrize(("name", "at_s", "body"), some(LOSSES, 3))
def test_a_lost_journal_is_a_matter_of_minutes(name: str, at_s: int, body: str) -> None:
    came_s = at_s + 20
    crash = f"crash:target={name},at_s={at_s},restart_s=5,journal=lost"
    scene = played(crash, f"operate:do=regenerate,at_s={came_s},target={name}" + (f",body={body}" if body else ""))
    scene.assert_sound()
    node = SITE.machine(name).node_id
    _, word = scene.first(Halted, lambda one: one.sender == node)
    assert (word.reason, word.needs_person) == (Reason.JOURNAL_LOST, True)
    street = scene.simulation.plant.street.summary()
    assert (street.parked, street.served, street.queueing, street.asking) == (4, 3, 0, 0)
    done = [t / 1e6 for t, one in scene.all(TaskReport) if one.phase is TaskPhase.DONE]
    assert min(t for t in done if t > came_s) < came_s + 300
    epochs = {beat.sender: beat.epoch for _, beat in scene.all(Heartbeat)}
    assert set(epochs.values()) == {1}
    log = [line for _, who, line in scene.simulation.log.lines if who == "operator"]
    assert f"{name} is in epoch 1" in log


@pytest.mark.parametrize(
    ("name", "at_s", "site"),
    [
        pytest.param("IOC1", 60, SITE, id="a robot has its car aboard"),
        pytest.param("IOC1", 70, at_arrival(SITE), id="somebody drives in"),
        pytest.param("IOC1", 340, SITE, id="a ticket was put in"),
        pytest.param("IOC1", 372, at_arrival(SITE), id="a car is brought"),
        pytest.param("IOC1", 396, at_arrival(SITE), id="a car that was fetched stands in the bay"),
        pytest.param("IOC1", 424, at_arrival(SITE), id="its driver takes it meanwhile"),
        pytest.param("ER1", 104, SITE, id="a robot is aboard between two floors"),
    ],
)
def test_rights_are_made_anew_in_the_middle_of_work(name: str, at_s: int, site: Site) -> None:
    """By an empty journal a car that a robot has is the compartment's own, no number was given, and nobody rides.

    Who presses the key meanwhile reads OUT_OF_ORDER, and drives out again.
    """
    lost = f"crash:target={name},at_s={at_s},restart_s=5,journal=lost"
    scene = played(lost, f"operate:do=regenerate,at_s={at_s + 20},target={name}", site=site)
    scene.assert_sound()
    street, told = scene.simulation.plant.street.summary(), [one.text for _, one in scene.all(DeskOrder, "IOC1")]
    refused = street.refused_full
    assert refused <= told.count(DeskText.OUT_OF_ORDER) and refused <= 1
    assert (street.parked, street.served, street.queueing, street.asking) == (4 - refused, 3 - refused, 0, 0)


@pytest.mark.parametrize(("at_s", "body", "car"), some([(88, "p(1;5)", 1), (171, "p(1;4)", 2), (255, "p(1;6)", 3)], 1))
def test_a_car_that_was_left_before_its_word_was_lost_stands_where_it_is(at_s: int, body: str, car: int) -> None:
    """Its robot was believed to have it aboard for ever, and gave the place to the next: two cars in one place."""
    name = "MR2" if car == 2 else "MR1"
    lost = f"crash:target={name},at_s={at_s},restart_s=3,journal=rolled_back,entries=8"
    scene = played(lost, f"operate:do=regenerate,at_s={at_s + 20},target={name},body={body}")
    assert scene.simulation.plant.oracle.finish() == []
    said = [one.station for _, one in scene.all(CarAt) if one.car.number == car]
    assert said[-1] == OUTSIDE, "its driver has it"
    street = scene.simulation.plant.street.summary()
    assert (street.queueing, street.asking) == (0, 0)


#: Its shuttle reaches for a car in the bay, brings one in, has one aboard, lets one go, comes home empty.
IN_HAND = [(60, "p(1;5)"), (102, "p(1;5)"), (116, "p(1;5)"), (130, "p(1;4)"), (193, "p(1;6)")]


#: How its journal is lost, and whether it is started once more right after its rights were made anew.
HARMS = [("lost", False), ("rolled_back,entries=8", True), ("lost", True), ("rolled_back,entries=8", False)]


@pytest.mark.parametrize(
    ("at_s", "body", "harm", "again"), some([(*one, *harm) for harm in HARMS for one in IN_HAND], 5)
)
def test_a_robot_that_lost_its_journal_brings_away_what_it_has_in_hand(
    at_s: int, body: str, harm: str, again: bool
) -> None:
    """Rule G8."""
    came_s, site = at_s + 40, at_arrival(SITE)
    faults = [f"crash:target=MR1,at_s={at_s},restart_s=5,journal={harm}"]
    faults += [f"crash:target=MR1,at_s={came_s + 5.2},restart_s=5"] if again else []
    scene = played(*faults, f"operate:do=regenerate,at_s={came_s},target=MR1,body={body}", site=site)
    assert scene.simulation.plant.oracle.finish() == []
    assert scene.verdict().is_good, "also of tasks that their robot forgot it is said that they are done"
    street = scene.simulation.plant.street.summary()
    assert (street.queueing, street.asking) == (0, 0)
    done = [t / 1e6 for t, one in scene.all(TaskReport) if one.phase is TaskPhase.DONE]
    assert min(t for t in done if t > came_s) < came_s + 300
    assert not [line for _, who, line in scene.simulation.log.lines if who == "MR1" and "held for a person" in line]


def test_a_dead_robot_is_towed_regenerated_and_its_slot_is_nobodys() -> None:
    """docs/operate.md, "A dead one"."""
    scene = played(
        "crash:target=MR1,at_s=97,restart=no",
        "moved:target=MR1,at_s=110,by_mm=-9000",
        "operate:do=regenerate,at_s=120,target=MR1,absent=yes,track=1,index=1",
    )
    scene.assert_sound()
    street = scene.simulation.plant.street.summary()
    assert (street.parked, street.served, street.queueing, street.asking) == (4, 3, 0, 0)


def test_a_robot_that_is_declared_dead_and_comes_back_in_the_old_epoch_does_nothing() -> None:
    scene = played(
        "crash:target=MR1,at_s=97,restart_s=100",
        "moved:target=MR1,at_s=110,by_mm=-9000",
        "operate:do=regenerate,at_s=120,target=MR1,absent=yes,track=1,index=1",
    )
    assert scene.simulation.plant.oracle.finish() == []
    node = SITE.machine("MR1").node_id
    states = {one.state.name for t, one in scene.all(Heartbeat) if one.sender == node and t > 205e6}
    assert states <= {"OBSTACLE", "STARTING"}
    assert scene.simulation.plant.street.summary().served == 3


def test_a_robot_that_lives_cannot_be_declared_dead() -> None:
    scene = played("operate:do=regenerate,at_s=60,target=MR1,absent=yes,track=1,index=5")
    scene.assert_sound()
    log = [line for _, who, line in scene.simulation.log.lines if who == "operator"]
    assert "MR1 lives: it is not absent" in log and not scene.all(Regeneration)


def test_an_operator_that_is_gone_leaves_a_site_that_goes_on() -> None:
    """FREEZE is not said any more: after ten seconds all go on with the rights that they had."""

    def before(simulation: Simulation) -> None:
        bus = simulation.fleet.attach("operator", 251)
        word = Regeneration(251, RegenerationPhase.FREEZE, 1, SITE.machine("MR1").node_id, 0, 0, 0)
        for frame in simulation.codecs.fleet.encode(word):
            simulation.loop.call_at(45.0, bus.send, frame)

    scene = play(SITE, CARS, before=before, limit_s=1_500)
    scene.assert_sound()
    assert scene.simulation.plant.street.summary().served == 3
    assert {beat.epoch for _, beat in scene.all(Heartbeat)} == {0}


def test_who_presses_the_key_of_a_compartment_that_lost_its_journal_reads_so() -> None:
    """It waited for an answer until a person had come, and then for ever: nothing was remembered of it."""
    faults = ["crash:target=IOC1,at_s=4,restart_s=3,journal=lost", "operate:do=regenerate,at_s=100,target=IOC1"]
    scene = played(*faults, site=at_arrival(SITE))
    scene.assert_sound()
    read = [one.text for t, one in scene.all(DeskOrder, "IOC1") if t < 100e6]
    assert set(read) == {DeskText.OUT_OF_ORDER}
    street = scene.simulation.plant.street.summary()
    assert (street.queueing, street.asking, street.served) == (0, 0, 1), "the first two drive out, the third is served"


def test_a_desk_that_forgot_its_tickets_asks_for_them_though_it_is_steward_of_nothing() -> None:
    """IOC2 of `standard` has no slots of its own; its rights were made anew all the same."""
    site = find_site("standard")
    faults = ["crash:target=IOC2,at_s=205,restart_s=5,journal=lost", "operate:do=regenerate,at_s=225,target=IOC2"]
    scene = play(
        site,
        stays((0, 190), (10, 195), (20, 200)),
        plant=lambda simulation: arm(simulation, [parse_injection(one) for one in faults]),
        limit_s=600,
    )
    scene.assert_sound()
    asked = {bus for bus in ("IOC1", "IOC2", "IOC3") for _, one in scene.all(DeskOrder, bus) if one.text is AGAIN}
    assert asked == {"IOC2"}
    street = scene.simulation.plant.street.summary()
    assert (street.served, street.asking) == (3, 0)
