"""A machine that has lost its journal, and statements that only one node may make."""

from binascii import crc_hqx
from struct import pack

import pytest

from onboard.contract.codes import CONTRACT_VERSION, KindCode, MachineState, Reason, TokenKind
from onboard.contract.constants import OUTSIDE
from onboard.contract.messages import CarAt, Halted, Heartbeat, Reference, SyncRequest, TokenGrant, TokenHeld
from onboard.core.authority import segment_token
from onboard.core.effects import Report, Send
from onboard.core.site import Segment
from onboard.holon.holon import Holon
from onboard.systems.registry import factory_for
from onboard.ways.cars import MAX_GONE_CARS
from onboard.ways.mirror import WayMirror, way_mirror
from onboard.ways.tokens import car_token
from tests.core.walkers import Alley
from tests.sites import one_floor

SITE = one_floor(robots=1)
STEWARD, ROBOT = 1, 11


def holon(boot: int, *entries: dict[str, str | int]) -> Holon:
    made = Holon(SITE, SITE.machines[STEWARD], factory_for(SITE, KindCode.COMPARTMENT), boot=boot, entries=entries)
    made.start(0)
    return made


@pytest.mark.parametrize(
    ("journalled", "boot", "before", "silent"),
    [
        ([], 1, 0, False),
        ([], 1, 7, True),
        ([1], 2, 1, False),
        ([1], 2, 2, False),
        ([1], 2, 5, True),
        ([254, 255], 1, 255, False),
    ],
)
def test_a_node_without_the_journal_of_a_life_that_others_knew_falls_silent(
    journalled: list[int], boot: int, before: int, silent: bool
) -> None:
    entries: list[dict[str, str | int]] = [{"record": "boot", "boot": one} for one in journalled]
    machine = holon(boot, *entries)
    effects = machine.receive(SyncRequest(ROBOT, STEWARD, before), 10)
    held = [effect.message for effect in effects if isinstance(effect, Send) and isinstance(effect.message, Halted)]
    assert any(word.needs_person and word.reason is Reason.JOURNAL_LOST for word in held) is silent
    assert any(isinstance(effect, Report) and "regenerate" in effect.text for effect in effects) is silent


def test_peers_tell_a_restarted_node_which_life_they_knew() -> None:
    machine = holon(1)

    def beat(boot: int, state: MachineState, now_us: int = 10) -> list[SyncRequest]:
        word = Heartbeat(ROBOT, CONTRACT_VERSION, SITE.digest, 0, boot, KindCode.ROBOT, state)
        said = machine.receive(word, now_us)
        return [e.message for e in said if hasattr(e, "message") and isinstance(e.message, SyncRequest)]

    assert beat(4, MachineState.STARTING) == [], "nobody knew an earlier life of it: it is asked in a slot"
    assert beat(4, MachineState.IDLE) == []
    twice = beat(4, MachineState.STARTING, 5_000)
    assert all(said.boot_before == 0 for said in twice), "its first word has come twice"
    again = SyncRequest(STEWARD, ROBOT, 4)
    assert beat(4, MachineState.STARTING, 1_500_000) == [again], "it started again under the same counter"
    assert beat(5, MachineState.IDLE, 1_500_010) == [again]


def test_a_steward_whose_journal_is_gone_grants_nothing() -> None:
    """It would think that it holds tokens which it gave to walkers that stand there."""
    alley = Alley({11: [9], 12: [3]}, {11: [1], 12: [2]}, seed=1)
    alley.run(3)
    alley.journals[1].clear()
    alley.restart(1, 1)
    alley.run(3)
    steward = alley.holons[1]
    assert steward.holding.why.reason is Reason.JOURNAL_LOST
    assert not any(steward.tokens.holds(key) for key in (segment_token(Segment(1, index)) for index in range(1, 13)))


def test_a_steward_with_its_journal_goes_on_where_it_was() -> None:
    alley = Alley({11: [9], 12: [3]}, {11: [1], 12: [2]}, seed=1)
    alley.run(3)
    alley.restart(1, 2)
    alley.run(60)
    alley.assert_in_order()
    assert alley.walker(11).is_home and alley.walker(12).is_home


def test_one_version_of_a_cars_token_has_one_custodian() -> None:
    mirror = WayMirror(SITE, 1)
    car = Reference(1, 5)
    place, other = SITE.places[0].number, SITE.places[1].number
    assert mirror.on_car(CarAt(1, car, place, 3, 2500))
    assert not mirror.on_car(CarAt(11, car, other, 3, 2500)), "somebody else under the same version"
    assert not mirror.on_car(CarAt(11, car, other, 2, 2500)), "an older one"
    assert mirror.on_car(CarAt(1, car, other, 3, 2500)), "the custodian itself may move it"
    assert mirror.on_car(CarAt(11, car, place, 4, 2500))
    assert mirror.cars[car].custodian == 11


def test_the_digest_is_what_it_says_it_is_of_whatever_cars_came_moved_and_left() -> None:
    """Kept from word to word, and the same as one over all cars in the order of their numbers (docs/protocol.md)."""
    mirror = WayMirror(SITE, 1)
    places = [place.number for place in SITE.places]
    words = [(2, 7, 3), (1, 9, 4), (2, 1, 5), (1, 9, 6), (2, 7, None), (1, 2, 3), (2, 8, 0)]
    standing: dict[Reference, int] = {}
    ordered: list[tuple[Reference, int]] = []
    for version, (origin, number, place) in enumerate(words, start=1):
        car, station = Reference(origin, number), OUTSIDE if place is None else places[place]
        assert mirror.on_car(CarAt(11, car, station, version, 2500))
        standing[car] = station
        ordered = [(car, at) for car, at in sorted(standing.items()) if at != OUTSIDE]
        told = b"".join(pack(">BBHI", 0, car.origin, car.number, at) for car, at in ordered)
        assert mirror.digest() == crc_hqx(told, 0xFFFF)
    mirror.on_car(CarAt(1, Reference(2, 8), places[0], 9, 2500))
    mirror.disown()
    told = b"".join(pack(">BBHI", 0, car.origin, car.number, at) for car, at in ordered if car != (2, 8))
    assert mirror.digest() == crc_hqx(told, 0xFFFF)


def test_cars_that_left_long_ago_leave_nothing_behind() -> None:
    """A machine runs for years: what it knows of tokens and winners is bounded by the cars that are there."""
    machine = holon(1)
    machine.tokens.trust()
    for number in range(1, 4 * MAX_GONE_CARS):
        car = Reference(STEWARD, number)
        machine.tokens.create(car_token(*car))
        machine.tokens.give(car_token(*car), ROBOT, 10)
        machine.receive(TokenHeld(ROBOT, TokenKind.CAR, car_token(*car).number, 2), 10)
        machine.receive(CarAt(ROBOT, car, SITE.places[0].number, 2, 2500), 10)
        machine.receive(TokenGrant(ROBOT, TokenKind.CAR, car_token(*car).number, 3, STEWARD), 10)
        assert machine.tokens.holds(car_token(*car))
        way_mirror(machine.mirror).on_car(CarAt(STEWARD, car, OUTSIDE, 3, 2500))
    for table in (way_mirror(machine.mirror).cars, machine.tokens.seen, machine.tokens.held, machine.tokens.given):
        assert len(table) <= MAX_GONE_CARS + 1
    first = Reference(STEWARD, 1)
    machine.tokens.create(car_token(*first))
    assert way_mirror(machine.mirror).on_car(CarAt(STEWARD, first, SITE.places[0].number, 1, 2500)), (
        "numbers come again"
    )


def test_cars_that_are_there_are_never_forgotten_however_many_have_left() -> None:
    mirror = WayMirror(SITE, 1)
    forgotten: list[Reference] = []
    mirror.on_forgotten.append(forgotten.append)
    for number in range(1, MAX_GONE_CARS):
        mirror.on_car(CarAt(1, Reference(1, number), SITE.places[0].number, 1, 2500))
    for number in range(1, MAX_GONE_CARS):
        mirror.on_car(CarAt(1, Reference(2, number), OUTSIDE, 1, 2500))
    assert forgotten == []
    for number in range(MAX_GONE_CARS, MAX_GONE_CARS + 3):
        mirror.on_car(CarAt(1, Reference(2, number), OUTSIDE, 1, 2500))
    assert forgotten == [Reference(2, 1), Reference(2, 2)]
