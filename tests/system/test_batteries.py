"""Robots on batteries: they charge when nobody calls, give way to customers above the floor, and stand when empty."""

import json
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from bus_sim.campaign.profiles import kinds_for
from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.systems.car_park.battery_figures import battery_figures, battery_lines
from bus_sim.systems.car_park.power import OF_BATTERIES
from bus_sim.systems.car_park.simulation import Simulation
from onboard.config.site import parse_site
from onboard.contract.battery import BatteryLevel
from onboard.contract.codes import Grade, LegAction, Reason, TaskPhase
from onboard.contract.messages import Bid, Halted, Itinerary, Message, TaskReport
from onboard.core.site import Segment
from onboard.gateway.publisher import FLEET, Publisher
from onboard.gateway.settings import GatewaySettings
from onboard.systems.car_park.report import lines
from onboard.systems.car_park.site import CarPark, RestAt, car_park
from onboard.trace.view import SiteView
from onboard.ways.occupancy import final_position
from onboard.web.picture import LivePicture
from tests.mqtt.logs import EPOCH_US, validator
from tests.system.scene import Scene, play, stays

TEXT = (Path(__file__).parents[2] / "bus_sim" / "sites" / "small.toml").read_text(encoding="utf-8")
MR1, MR2 = 11, 12
HOMES = {MR1: Segment(2, 3), MR2: Segment(3, 8)}


@cache
def site(more: str = "") -> CarPark:
    """Batteries that last for an hour of rest, and are charged as fast."""
    text = f"{TEXT}\n[battery]\ncapacity_wh = 80\ncharge_w = 400\n{more}"
    return car_park(parse_site(text, "small.toml"))


def begin(first: float, second: float = 1.0, *faults: str) -> Callable[[Simulation], None]:
    """How full the batteries of both robots are at power-up."""

    def plant(simulation: Simulation) -> None:
        for node, part in ((MR1, first), (MR2, second)):
            simulation.plant.batteries[node].set_charge(part)
        arm(simulation, [parse_injection(fault) for fault in faults])

    return plant


@cache
def one_car(first: float, second: float = 1.0) -> Scene:
    found = play(site(), stays((5, 100)), plant=begin(first, second), extra_s=200)
    found.assert_sound()
    return found


def fleet(found: Scene) -> list[tuple[int, Message]]:
    return [(said.time_us, said.message) for said in found.said if said.bus == "fleet"]


def levels(found: Scene, node: int) -> list[BatteryLevel]:
    return [one for _, one in found.all(BatteryLevel, "fleet") if one.sender == node]


def bidders(found: Scene) -> set[int]:
    return {one.sender for _, one in found.all(Bid, "fleet")}


def moves_to_charge(found: Scene, node: int) -> list[Itinerary]:
    """Its plans without work that end at a charger, elsewhere than they begin."""
    mine = [one for _, one in found.all(Itinerary, "fleet") if (one.sender, one.grade) == (node, Grade.FIRM)]
    idle = [one for one in mine if {leg.action for leg in one.legs} <= {LegAction.TRAVEL, LegAction.RIDE}]
    return [one for one in idle if final_position(site(), one) in HOMES.values() and one.stamp.initiator == node]


def test_with_nothing_to_do_and_little_in_it_a_robot_goes_to_a_charger_and_is_charged_there() -> None:
    found = one_car(0.7)
    assert moves_to_charge(found, MR1)
    assert found.simulation.plant.world.standing_segment(MR1) in HOMES.values()
    last = levels(found, MR1)[-1]
    assert last.charging and last.charge_permille > min(one.charge_permille for one in levels(found, MR1))
    assert not moves_to_charge(found, MR2), "who is full stays where its work ended"


def test_above_the_floor_charging_gives_way_to_customers_and_below_it_does_not() -> None:
    # MR1 is nearer to the compartment: it serves the customer from its charger, unless it has to charge first.
    assert MR1 in bidders(one_car(0.7))
    low = one_car(0.2)
    assert bidders(low) == {MR2}
    assert not levels(low, MR1)[0].bids
    assert all(one.bids for one in levels(low, MR2))


def test_who_had_to_charge_first_bids_again_once_it_is_ready() -> None:
    # From 20 % to 50 % of 80 Wh at 320 W: 270 s.
    found = play(site(), stays((5, 60), (400, 460)), plant=begin(0.2))
    found.assert_sound()
    told = [(us, one.bids) for us, one in found.all(BatteryLevel, "fleet") if one.sender == MR1]
    ready_us = next(us for us, bids in told if bids)
    assert 270 <= ready_us / 1e6 <= 301, "the gauge speaks every 30 s"
    bids_us = [us for us, one in found.all(Bid, "fleet") if one.sender == MR1]
    assert bids_us and min(bids_us) > ready_us


def test_where_all_have_to_charge_first_customers_do_not_wait_for_that() -> None:
    # Both below the floor: as they stand, MR1 would be ready after 270 s.
    low = one_car(0.2, 0.15)
    assert not any(one.bids for node in (MR1, MR2) for one in levels(low, node)), "what each says of itself stays"
    served_us, _ = low.first(TaskReport, lambda one: one.phase is TaskPhase.DONE)
    assert served_us < 120_000_000


def test_a_bid_that_the_battery_cannot_pay_for_is_not_made() -> None:
    # Above the floor of 1 %, and less than a task takes.
    park = site("floor_percent = 1\nready_percent = 2")
    found = play(park, stays((5, None)), plant=begin(0.03), limit_s=400)
    assert bidders(found) == {MR2}
    assert all(one.bids for one in levels(found, MR1))


def test_a_task_that_the_battery_cannot_pay_for_any_more_is_given_back_untouched_and_done_by_the_other() -> None:
    # Half way to the compartment what is left is good for some 40 s of driving.
    fault = "battery_drop:target=MR1,at_s=24,percent=10,for_s=100000"
    found = play(site(), stays((5, None)), plant=begin(1.0, 1.0, fault), limit_s=150, extra_s=90)
    told = [(one.sender, one.phase, one.reason) for _, one in found.all(TaskReport, "fleet")]
    assert told[:2] == [(MR1, TaskPhase.AWARDED, Reason.NONE), (MR1, TaskPhase.FORFEITED, Reason.IMPOSSIBLE)]
    assert (MR2, TaskPhase.DONE, Reason.NONE) in told
    assert levels(found, MR1)[-1].charging, "and it came to a charger with the rest"


#: Robots begin where they are not charged.
AWAY = 'chargers = ["p(2,7)", "p(3,3)"]'


@cache
def _empty() -> Scene:
    fault = "battery_drop:target=MR1,at_s=40,percent=0,for_s=100000"
    return play(site(AWAY), stays((90, 160)), plant=begin(1.0, 1.0, fault))


def test_an_empty_robot_stands_and_is_told_and_the_other_serves_everybody() -> None:
    found = _empty()
    assert found.simulation.plant.street.is_over
    assert bidders(found) == {MR2}
    _, halted = found.first(Halted, lambda one: one.machine == MR1)
    assert (halted.sender, halted.reason, halted.needs_person) == (MR1, Reason.ACTUATOR_FAULT, True)
    assert levels(found, MR1)[-1] == BatteryLevel(MR1, 0, charging=False, bids=False)


def test_page_and_vda_5050_and_the_events_tell_batteries() -> None:
    found = _empty()
    view, picture = SiteView(site(AWAY)), LivePicture(site(AWAY))
    publisher = Publisher(site(AWAY), GatewaySettings(epoch_us=EPOCH_US))
    states: dict[str, Any] = {}
    for time_us, message in fleet(found):
        view.feed(message, time_us)
        picture.feed(message, time_us)
        out = publisher.feed(message, time_us)
        while (due_us := publisher.next_wake()) <= time_us:
            out += publisher.wake(due_us)
        for one in out:
            if one.link != FLEET and one.publication.topic.endswith("/state"):
                states[one.link] = json.loads(one.publication.payload)
    assert "MR1 stands: its battery is empty" in [text for _, text in view.events]
    machines = picture.snapshot()["machines"]
    assert machines[MR1]["battery"] == {"percent": 0.0, "charging": False, "bids": False}
    assert machines[MR2]["battery"]["percent"] > 50
    assert states["MR1"]["batteryState"] == {"batteryCharge": 0.0, "charging": False}
    assert states["MR2"]["batteryState"]["batteryCharge"] == machines[MR2]["battery"]["percent"]
    assert "batteryEmpty" in [one["errorType"] for one in states["MR1"]["errors"]]
    assert "batteryEmpty" not in [one["errorType"] for one in states["MR2"]["errors"]]
    assert all(validator("2.1", "state").is_valid(state) for state in states.values())


def test_a_person_charges_the_empty_robot_and_it_works_again() -> None:
    fault = "battery_drop:target=MR1,at_s=40,percent=0,for_s=30"
    found = play(site(AWAY), stays((200, 300)), plant=begin(1.0, 0.2, fault))
    assert found.simulation.plant.street.is_over
    assert MR1 in bidders(found)
    assert levels(found, MR1)[-1].charge_permille > 500


@pytest.mark.parametrize("at_s", [36, 63, 117])
def test_at_whatever_moment_of_its_work_it_is_empty_and_charged_again_everybody_is_served(at_s: int) -> None:
    # On its way to the first car, while it takes it, and between the two; 18 to 189 in steps of nine were played once.
    fault = f"battery_drop:target=MR1,at_s={at_s},percent=0,for_s=60"
    found = play(site(AWAY), stays((5, 100), (60, 150)), plant=begin(1.0, 1.0, fault), limit_s=900, extra_s=0)
    assert found.simulation.plant.street.is_over
    found.assert_sound()
    assert {one.machine for _, one in found.all(Halted, "fleet")} == {MR1}


def test_without_current_a_robot_goes_to_another_charger() -> None:
    def plant(simulation: Simulation) -> None:
        begin(0.7)(simulation)
        simulation.plant.set_dead(frozenset([HOMES[MR1]]))

    park = car_park(parse_site(TEXT + '\n[battery]\ncapacity_wh = 80\nchargers = ["p(2,3)", "p(2,7)", "p(3,8)"]', "a"))
    found = play(park, stays((5, 60)), plant=plant, extra_s=300)
    assert found.simulation.plant.world.standing_segment(MR1) == Segment(2, 7)
    assert levels(found, MR1)[-1].charging


def test_where_robots_wait_by_demand_one_that_is_charged_stays_until_it_is_full() -> None:
    park = replace(site(AWAY), rest_at=RestAt.DEMAND)
    found = play(park, stays(), plant=begin(0.7), extra_s=400)
    found.assert_sound()
    full_us = next(us for us, one in found.all(BatteryLevel, "fleet") if one.charging and one.charge_permille == 1000)
    mine = [(us, one) for us, one in found.all(BatteryLevel, "fleet") if one.sender == MR1 and us < full_us]
    began_us = next(us for us, one in mine if one.charging)
    assert all(one.charging for us, one in mine if us >= began_us)


def test_the_report_of_a_site_tells_its_batteries() -> None:
    assert "batteries: 80 Wh, 1.0 h at rest, 0.1 h of driving; chargers: p(2,3), p(3,8)" in lines(site())
    assert not [line for line in lines(car_park(parse_site(TEXT, "small.toml"))) if "batteries" in line]


def test_campaigns_draw_faults_of_batteries_only_where_robots_have_them() -> None:
    plain = parse_site(TEXT, "small.toml")
    assert kinds_for("power", site()).keys() & kinds_for("all", site()).keys() >= OF_BATTERIES
    assert not OF_BATTERIES & (kinds_for("power", plain).keys() | kinds_for("all", plain).keys())


def test_the_oracle_counts_an_empty_battery_where_nothing_has_struck_and_the_summary_tells_it() -> None:
    found = play(site(), stays(), plant=begin(1.0), before=_drained, extra_s=30)
    assert [one.rule.name for one in found.simulation.plant.oracle.violations] == ["POWER"]
    first, second = battery_figures(found.simulation)
    assert (first.name, first.lowest_percent, first.is_empty, second.is_empty) == ("MR1", 0.0, True, False)
    assert [line.endswith("EMPTY") for line in battery_lines((first, second))] == [False, True, False]


def _drained(simulation: Simulation) -> None:
    simulation.plant.set_dead(frozenset(HOMES.values()))
    simulation.plant.batteries[MR1].set_charge(0.0)
