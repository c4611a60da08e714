"""Until when what was said counts: the same for page, gateway, station and ``why``, as all read one history."""

from typing import Any

from bus_sim.sites import find_site
from onboard.contract.codes import (
    CONTRACT_VERSION,
    Grade,
    KindCode,
    LegAction,
    MachineState,
    Reason,
    Side,
)
from onboard.contract.messages import CarAt, Halted, Heartbeat, Itinerary, Leg, Progress, Reference, Stamp, Waiting
from onboard.contract.terminal import Action, PlanHead, PlanStep, StepReport, StepResult
from onboard.core.site import Segment
from onboard.gateway.publisher import Publisher
from onboard.gateway.settings import GatewaySettings
from onboard.history.history import History
from onboard.operate.park import Park
from onboard.operate.words import state_words
from onboard.web.picture import LivePicture

SITE = find_site("small")
MR1, MR2 = SITE.machine("MR1").node_id, SITE.machine("MR2").node_id
SECOND = 1_000_000


def beat(node: int, state: MachineState, boot: int = 1) -> Heartbeat:
    return Heartbeat(node, CONTRACT_VERSION, SITE.digest, 0, boot, KindCode.ROBOT, state)


def at(index: int, *, speed_mm_s: int = 0, version: int = 0, leg: int = 0) -> Progress:
    return Progress(MR1, version, leg, 1, index, 0, speed_mm_s)


def waits(picture: LivePicture) -> bool:
    return "wait" in picture.snapshot()["machines"][MR1]


def test_a_wait_is_over_where_its_machine_has_turned_on_the_spot_or_started_anew() -> None:
    """Who turns tells no speed: only the segment is another."""
    wait = Waiting(MR1, 1, 5, MR2, Reason.TOKEN_NOT_GRANTABLE_YET)
    for over in (at(5), at(4, speed_mm_s=100), beat(MR1, MachineState.STARTING, boot=2)):
        picture = LivePicture(SITE)
        for number, message in enumerate((beat(MR1, MachineState.WORKING), at(4), wait, at(4))):
            picture.feed(message, (number + 1) * SECOND)
        assert waits(picture), "it has said again where it stands"
        picture.feed(over, 6 * SECOND)
        assert not waits(picture)


def test_nobody_is_told_as_silent_by_a_neighbour_while_it_is_heard() -> None:
    picture, park = LivePicture(SITE), Park(SITE)
    word = Halted(MR2, MR1, Reason.NODE_SILENT, 0, False, 1)
    for number, message in enumerate((beat(MR1, MachineState.WORKING), word)):
        picture.feed(message, (number + 1) * SECOND)
        park.feed(message, (number + 1) * SECOND)
    assert picture.snapshot()["events"] == []
    assert state_words(park, MR1, 2 * SECOND) == "works"
    later_us = 2 * SECOND + 3 * SITE.timing.heartbeat_us
    picture.feed(word, later_us)
    assert [text for _, text in picture.snapshot()["events"]] == ["MR1 does not act: node silent"]


def test_who_says_that_it_acts_is_not_told_as_halted() -> None:
    publisher, park = Publisher(SITE, GatewaySettings()), Park(SITE)

    def errors() -> Any:
        return [publisher.machines.halted(MR1, 3 * SECOND), park.halted(MR1, 3 * SECOND)]

    for message in (beat(MR1, MachineState.OBSTACLE), Halted(MR1, MR1, Reason.EMERGENCY_STOP, 251, False, 1)):
        publisher.feed(message, 2 * SECOND)
        park.feed(message, 2 * SECOND)
    assert None not in errors()
    for view in (publisher, park):
        view.feed(beat(MR1, MachineState.IDLE), 3 * SECOND)
    assert errors() == [None, None]


def test_a_leg_counts_for_the_plan_that_it_names() -> None:
    history = History(SITE)
    legs = tuple(Leg(LegAction.TRAVEL, 1, one, one + 1, Side.NEAR, 1_000 * one) for one in (1, 2, 3))
    for version in (1, 2):
        history.feed(Itinerary(MR1, version, Grade.FIRM, Stamp(0, MR1, 0), legs), version * SECOND)
    history.feed(at(2, version=1, leg=2), 3 * SECOND)
    assert history.plans.ahead(MR1) == legs, "it was said of the plan before"
    history.feed(at(2, version=2, leg=2), 4 * SECOND)
    assert history.plans.ahead(MR1) == legs[2:]


def test_a_load_is_aboard_one_machine_at_most() -> None:
    history, car = History(SITE), Reference(1, 7)
    for node in (MR1, MR2):
        history.feed(CarAt(node, car, 0xFFFF, 1, 2_700), SECOND)
    assert history.loads.aboard == {MR2: car} and history.loads.standing() == {}


def test_a_terminal_s_plan_that_is_told_anew_goes_on_where_it_was() -> None:
    site = find_site("terminal")
    publisher = Publisher(site, GatewaySettings())
    vehicle = site.machine("R1").node_id
    lanes = list(site.stewards)[:3]

    def tell(version: int) -> None:
        publisher.feed(PlanHead(vehicle, version, len(lanes), 0, 5_000), version * SECOND)
        for number, lane in enumerate(lanes):
            publisher.feed(PlanStep(vehicle, version, number, Action.GOTO, lane, 1_000, 0, 0), version * SECOND)

    tell(1)
    before = publisher.machines.where(vehicle).ahead
    publisher.feed(StepReport(vehicle, 1, 0, StepResult.DONE, lanes[0], 6_000), 2 * SECOND)
    tell(2)
    assert len(publisher.machines.where(vehicle).ahead) == len(before) - 2, "one is done, and in one it is"


def test_places_are_at_home_before_the_first_word() -> None:
    history = History(SITE)
    assert history.places.by_node[MR1].segment == SITE.machine("MR1").home
    history.feed(at(3), SECOND)
    assert history.places.by_node[MR1].segment == Segment(1, 3)
