"""What customers are promised: at the desk, on the bus, on the page and over MQTT, as first shown; and only there."""

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

from bus_sim.systems.car_park.promised import PromiseFigures, seen_of
from onboard.contract.base import Reference
from onboard.contract.car_park import Promise
from onboard.contract.car_park_device import DeskPromise
from onboard.contract.codes import DeskInput, DoorPosition, LightColour
from onboard.contract.messages import (
    BayState,
    CarAt,
    DeskEvent,
    DoorState,
    Message,
    SyncRequest,
    TicketRead,
)
from onboard.core.effects import Effect, Send, Tell
from onboard.core.serial import to_bus_ms
from onboard.gateway.fleet import FleetTopics
from onboard.gateway.settings import GatewaySettings
from onboard.holon.holon import Holon
from onboard.systems.car_park.bay_generation import BayGeneration
from onboard.systems.car_park.promises import LEAST_CYCLES, MOST_CYCLES, STEP_US, TOLD_US
from onboard.systems.registry import factory_for
from onboard.web.picture import LivePicture
from tests.sites import one_floor
from tests.system.scene import Scene, play, stays
from tests.system.test_desks import two

PROMISING = replace(one_floor(), promises=True)
BAY, ROBOT = 1, 11
CAR, OTHER = Reference(BAY, 7), Reference(BAY, 8)


@cache
def three_who_ask() -> Scene:
    """One asks alone, and later two at nearly the same time."""
    return play(PROMISING, stays((0, 200), (100, 400), (300, 410)))


def told() -> Iterator[tuple[int, Message]]:
    """The fleet bus."""
    return ((said.time_us, said.message) for said in three_who_ask().said if said.bus == "fleet")


def test_each_who_asks_is_told_once_at_the_desk_and_all_hear_the_same_on_the_bus() -> None:
    scene = three_who_ask()
    words, shown = scene.all(Promise, "fleet"), scene.all(DeskPromise)
    assert len(words) == len({word.car for _, word in words}) == 3
    first = {word.car: (time_us, word) for time_us, word in reversed(shown)}
    for customer, (said_us, word) in zip(scene.simulation.plant.street.customers, words, strict=True):
        read = customer.visit.promised
        assert read is not None and customer.visit.asked_us is not None
        assert 0 < read.read_us - customer.visit.asked_us < TOLD_US + 100_000
        assert abs(read.read_us - said_us) < 50_000
        assert abs(read.ready_us - word.ready_ms * 1_000) < 10_000 and read.spread_us == word.spread_ms * 1_000
        assert word.car in first


def test_the_car_of_who_asks_alone_is_there_when_it_was_promised() -> None:
    visit = three_who_ask().simulation.plant.street.customers[0].visit
    assert visit.promised is not None and visit.ready_us is not None
    # Told with the award, of a robot that nobody is in the way of: the output door is all that is not known yet.
    assert visit.promised.spread_us <= PROMISING.timing.door_us
    assert abs(visit.ready_us - visit.promised.ready_us) <= visit.promised.spread_us


def test_who_stands_behind_another_is_told_later_and_less_exactly() -> None:
    second, third = (one.visit for one in three_who_ask().simulation.plant.street.customers[1:])
    assert second.promised is not None and third.promised is not None
    assert third.promised.ready_us > second.promised.ready_us + 20_000_000
    assert third.promised.spread_us > second.promised.spread_us


def test_the_run_s_summary_counts_what_was_promised_and_kept() -> None:
    seen = seen_of(one.visit for one in three_who_ask().simulation.plant.street.customers)
    figures = PromiseFigures.of(seen)
    assert figures is not None and figures.count == 3
    assert figures.kept == sum(abs(one.there_us - one.ready_us) <= one.spread_us for one in seen) / 3
    assert "promised     3 customers" in figures.line()


def test_nothing_is_promised_where_the_site_does_not_ask_for_it() -> None:
    scene = play(one_floor(), stays((0, 100)), limit_s=400)
    assert not scene.all(Promise) and not scene.all(DeskPromise)
    assert scene.simulation.plant.street.customers[0].visit.promised is None


def test_who_is_sent_to_another_compartment_reads_at_the_desk_of_the_ticket_what_that_one_promises() -> None:
    scene = play(replace(two("nearest"), promises=True), stays((0, 150)))
    (_, word), *others = scene.all(Promise, "fleet")
    assert word.sender == 2 and not others
    for desk in ("IOC1", "IOC2"):
        shown_us, shown = scene.all(DeskPromise, desk)[0]
        assert shown.car == word.car and shown.spread_ms == word.spread_ms
        assert abs(shown_us // 1_000 + shown.in_ms - word.ready_ms) < 20


def test_the_page_shows_a_promise_until_the_car_is_there() -> None:
    picture, shown = LivePicture(PROMISING), []
    for time_us, message in told():
        picture.feed(message, time_us)
        if isinstance(message, Promise | CarAt):
            shown.append(json.loads(json.dumps(picture.snapshot()))["promises"])
    first = next(one for one in shown if one)[0]
    assert first["at"] == "IOC1" and first["spread_us"] > 0
    assert max(map(len, shown)) == 2, "two waited at a time"
    assert picture.snapshot()["promises"] == []
    assert "promises" not in LivePicture(one_floor()).snapshot()


def test_a_promise_is_told_over_mqtt_and_with_the_task_of_the_car() -> None:
    topics = FleetTopics(PROMISING, GatewaySettings(epoch_us=0))
    said = [one for time_us, message in told() for one in topics.feed(message, time_us)]
    promises: list[Any] = [body for topic, body in said if topic == "promise"]
    assert len({body["car"] for body in promises}) == 3 and {body["by"] for body in promises} == {"IOC1"}
    for body in promises:
        assert body["at"] < body["ready"] and body["ready_from"] < body["ready"] < body["ready_to"]
    tasks = [body for topic, body in said if topic == "task" and body.get("what") == "retrieve"]
    over = {body["car"]: body for body in tasks if body["phase"] == "done"}
    assert {car: body["ready"] for car, body in over.items()} == {body["car"]: body["ready"] for body in promises}


class Desk:
    """A compartment alone, which knows two cars at places, and no robot that bids."""

    def __init__(self) -> None:
        machine = PROMISING.machines[BAY]
        self.holon, self.now_us = Holon(PROMISING, machine, factory_for(PROMISING, machine.kind), boot=1), 1_000
        self.holon.start(0)
        self.holon.tokens.trust()
        for number, car in enumerate((CAR, OTHER)):
            self.holon.receive(CarAt(ROBOT, car, PROMISING.places[number].number, 2, 2_700), self.now_us)
        locked = DoorState(BAY, DoorPosition.OPEN, DoorPosition.LOCKED, LightColour.GREEN)
        for state in (locked, BayState(BAY, 0, 0, 0, 0, False, False, 0)):
            self.holon.sense(state, self.now_us)

    def insert(self, sequence: int, car: Reference) -> list[Effect]:
        read = [TicketRead(BAY, sequence, half, 0) for half in range(2)]
        acts = (*read, DeskEvent(BAY, sequence, DeskInput.TICKET, car))
        return [effect for one in acts for effect in self.holon.sense(one, self.now_us)]

    def until(self, end_us: int) -> list[Effect]:
        effects: list[Effect] = []
        while (due_us := self.holon.next_wake()) is not None and due_us <= end_us:
            self.now_us = max(self.now_us, due_us)
            effects += self.holon.wake(self.now_us)
        self.now_us = end_us
        return effects


def promises_in(effects: list[Effect]) -> list[Promise]:
    return [one.message for one in effects if isinstance(one, Send) and isinstance(one.message, Promise)]


def test_who_is_told_before_anything_is_known_is_told_by_the_site_s_own_constants_and_within_four_seconds() -> None:
    desk = Desk()
    asked_us = desk.now_us
    said = desk.insert(1, CAR) + desk.insert(2, OTHER)
    assert not promises_in(said + desk.until(asked_us + TOLD_US - 1))
    told_us = asked_us + TOLD_US
    effects = desk.until(told_us)
    one, two = promises_in(effects)
    assert (one.car, two.car) == (CAR, OTHER)
    cycle_us = BayGeneration(PROMISING, PROMISING.machines[BAY], lambda _, now_us: now_us, ()).cycle_us()
    assert one.ready_ms + one.spread_ms == to_bus_ms(told_us + MOST_CYCLES * cycle_us)
    early_us = told_us + LEAST_CYCLES * cycle_us - 1_000 * (one.ready_ms - one.spread_ms)
    assert 0 <= early_us <= 2 * STEP_US, "to the early side it is rounded up"
    assert two.ready_ms > one.ready_ms and two.spread_ms >= one.spread_ms
    shown = [effect.message for effect in effects if isinstance(effect, Tell)]
    assert [word.car for word in shown if isinstance(word, DeskPromise)] == [CAR, OTHER]


def test_who_asks_what_others_know_hears_what_is_promised_and_customers_are_not_told_again() -> None:
    desk = Desk()
    desk.insert(1, CAR)
    said = promises_in(desk.until(desk.now_us + TOLD_US))
    desk.insert(2, CAR)
    assert not promises_in(desk.until(desk.now_us + 3 * TOLD_US))
    asked = desk.holon.receive(SyncRequest(ROBOT, 0, 0), desk.now_us)
    again = promises_in(asked + desk.until(desk.now_us + 5_000_000))
    assert said and again == said
