"""What the machines may put on the bus, and whether a running site keeps to it and to the bounds that follow."""

import dataclasses

import pytest

from bus_sim.campaign.power_up import large_with
from bus_sim.sites import find_site
from bus_sim.systems.car_park.burst import burst
from bus_sim.systems.car_park.meter import Meter
from bus_sim.systems.car_park.response import Measured, judge, measure, worst_by_message
from onboard.contract.codes import KindCode
from onboard.core.mirror import MISSED_HEARTBEATS
from onboard.systems.car_park.battery import Battery
from onboard.systems.car_park.site import RideCalls, car_park
from onboard.systems.car_park.traffic import excess, operation, power_up, reasons, waits
from onboard.trace.response import ANYBODY, Stream, fifo_bounds
from onboard.wire.dbc_file import fleet_layouts

#: Sent by gateways, to those who ask for everything again, or while rights are disputed, regenerated or stood still;
#: seals and levels of batteries, which only sites that ask for them have; while a site file is changed; and what
#: drivers announce.
NOT_IN_OPERATION = {
    "BatteryLevel", "FetchTime", "SiteNext",
    "Go", "Halted", "LeftOut", "OperatorOrder", "Regeneration", "RegenerationState", "SyncDone", "SyncRequest",
    "Seal", "SealAnswer", "SealChallenge", "SealFault", "SealTo",
    "TokenAssigned", "TokenDispute", "TokenGiven", "TokenSeen",
}  # fmt: skip


def test_every_message_of_the_contract_has_its_stream_from_those_who_may_send_it() -> None:
    planned = car_park(find_site("standard"))
    site = dataclasses.replace(planned, rides=RideCalls.BEFORE)
    streams = operation(site)
    assert {stream.name for stream in streams} == {layout.name for layout in fleet_layouts()} - NOT_IN_OPERATION
    rides = {stream.name for stream in streams if stream.node == ANYBODY}
    assert rides - {stream.name for stream in operation(planned) if stream.node == ANYBODY} >= {"Call", "CallParent"}
    senders = {layout.name: layout.senders for layout in fleet_layouts()}
    roles = {KindCode.ROBOT: "Robot", KindCode.LIFT: "Lift", KindCode.COMPARTMENT: "Compartment"}
    for stream in [*streams, *power_up(site)]:
        if stream.node != ANYBODY:
            assert roles[site.machines[stream.node].kind] in senders[stream.name]
    assert all(why for _, why in reasons())


def test_promises_have_a_stream_where_they_are_made() -> None:
    site = car_park(find_site("standard"))
    promising = operation(dataclasses.replace(site, promises=True))
    assert [one for one in promising if one not in operation(site)] == [
        one for one in promising if one.name == "Promise"
    ]
    assert {one.node for one in promising if one.name == "Promise"} == set(site.compartments)


def test_batteries_have_a_stream_where_robots_run_on_them() -> None:
    site = car_park(find_site("standard"))
    powered = operation(dataclasses.replace(site, battery=Battery(480, 200, 300, 300, 80, 960, 25, 50, 80, ())))
    assert {one.name for one in powered if one not in operation(site)} == {"BatteryLevel"}
    robots = {one.node_id for one in site.machines.values() if one.kind is KindCode.ROBOT}
    assert {one.node for one in powered if one.name == "BatteryLevel"} == robots


def test_streams_are_told_once_and_have_the_priority_of_their_identifiers() -> None:
    streams = operation(find_site("small"))
    assert len({(stream.node, stream.name) for stream in streams}) == len(streams)
    by_priority = sorted({(stream.priority >> 16, stream.name) for stream in streams})
    assert [name for _, name in by_priority][:2] == ["EmergencyStop", "TokenGrant"]


def test_more_than_a_stream_allows_is_told_with_the_time() -> None:
    stream = Stream(11, "Bid", 5, 150, 1_000_000, burst=2)
    assert excess([stream], [(time_us, 11, "Bid") for time_us in (0, 0, 1_000_000, 1_000_000)]) == []
    (line,) = excess([stream], [(0, 11, "Bid"), (5, 11, "Bid"), (999_999, 11, "Bid")])
    assert line == "Bid of node 11: 3 frames within 1000000 us up to 0.999999 s, at most 2 expected"
    assert excess([stream], [(0, 12, "Bid"), (0, 12, "Bid")]) == ["no stream for Bid"]


def test_jitter_lets_two_bursts_come_together_but_not_three() -> None:
    stream = Stream(ANYBODY, "Bid", 5, 150, 1_000_000, jitter_us=1_000_000)
    assert excess([stream], [(0, 11, "Bid"), (1, 12, "Bid")]) == []
    assert len(excess([stream], [(0, 11, "Bid"), (1, 12, "Bid"), (2, 13, "Bid")])) == 1


@pytest.mark.parametrize("site", ["level1", "small", "standard", "large"])
def test_every_shipped_site_has_bounds_at_its_own_bit_rate(site: str) -> None:
    loaded = find_site(site)
    bounds = fifo_bounds(operation(loaded), loaded.bitrate)
    assert all(bound.response_us is not None for bound in bounds)


@pytest.mark.parametrize("bit_rate", [125_000, 250_000, 500_000])
def test_26_machines_have_bounds_and_nobody_who_lives_counts_as_silent(bit_rate: int) -> None:
    site = large_with(26, bit_rate)
    bounds = worst_by_message(operation(site), bit_rate)
    assert all(fifo_us is not None for fifo_us, _ in bounds.values())
    beats_us = bounds["Heartbeat"][0]
    assert beats_us is not None
    assert beats_us + waits(site)["Heartbeat"] < MISSED_HEARTBEATS * site.timing.heartbeat_us


def test_where_all_say_more_than_they_may_no_frame_is_later_than_its_bound() -> None:
    site = large_with(26, 125_000)
    judged = judge(site, Meter(), 0.0, 0.0)
    assert judged.wrong == []
    assert judged.burst_us > 1_000_000, "it is a burst"
    played = burst(site)
    assert excess(operation(site), played.queued) == []
    assert played.replaced > 1_000
    assert all(played.worst[False, name] == played.on_bus[False, name] for name in ("EmergencyStop", "Award", "Bid"))


def test_without_budgets_the_same_is_more_than_the_bounds_allow_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("onboard.controller.outgoing.Bucket.take", lambda _bucket, _now_us: True)
    judged = judge(large_with(26, 125_000), Meter(), 0.0, 0.0)
    assert any(line.startswith("ItineraryLeg of node") for line in judged.wrong)


@pytest.fixture(scope="module", params=[125_000, 500_000])
def run(request: pytest.FixtureRequest) -> Measured:
    """Ten minutes of the small site: robots share lifts, cars come and go."""
    return measure(find_site("small"), request.param, 10)


def test_no_response_on_a_running_site_is_above_its_bound_and_no_traffic_beyond_its_streams(run: Measured) -> None:
    assert run.wrong == []
    assert run.meter.tasks >= 5
    seen = {name for at_start, name in run.meter.worst if not at_start}
    assert seen >= {"Heartbeat", "Call", "CallLoad", "Bid", "Award", "ItineraryLeg", "TokenGrant", "TokenHeld", "CarAt"}


def test_what_is_measured_is_at_least_a_frames_length_and_a_bound_that_is_too_low_would_be_noticed(
    run: Measured,
) -> None:
    shortest_us = 100 * 1_000_000 // run.site.bitrate
    assert all(worst_us > shortest_us for worst_us in run.meter.worst.values())
    legs = run.meter.worst[False, "ItineraryLeg"]
    assert legs > 4 * shortest_us, "the legs of an itinerary wait for each other"
