"""Where cars are moved while nobody waits one may stand elsewhere than it was called for: it is fetched from there."""

from dataclasses import replace

from onboard.contract.codes import LegAction, Operation, ShuttleMode, Side, TokenKind
from onboard.contract.messages import CarAt, Itinerary, TokenRequest
from onboard.core.effects import Send
from onboard.core.site import Station
from onboard.systems.car_park.recovery import award_record
from tests.kinds.board import BAY, BOOT, CALL, PLACE, SITE, STEWARD, TASK, Board

ELSEWHERE = Station(1, 11, Side.FAR)
FETCH = replace(CALL, operation=Operation.RETRIEVE, from_station=PLACE.number, to_station=BAY.number)
#: When a robot that was started again goes on, us.
GOES_ON_US = 3_000_000


def fetching() -> Board:
    """It stands before PLACE, and has won to fetch a car from there."""
    board = Board(BOOT, award_record(FETCH, PLACE, BAY, 1).entry, site=replace(SITE, quiet_moves=True))
    board.hears(CarAt(STEWARD, TASK, PLACE.number, 1, 2_700))
    board.stands(PLACE.index)
    board.shuttle(ShuttleMode.HOME)
    board.lives(GOES_ON_US)
    assert works(board.plans[-1]) == [PLACE, BAY]
    return board


def works(plan: Itinerary) -> list[Station]:
    return [Station(leg.track, leg.to_index, leg.side) for leg in plan.legs if leg.action is LegAction.WORK]


def asked(board: Board, station: Station) -> int:
    """How often it asked for a station's right."""
    said = [one.message for one in board.said if isinstance(one, Send)]
    wanted = (TokenKind.STATION, station.number)
    return sum(isinstance(one, TokenRequest) and (one.token_kind, one.token) == wanted for one in said)


def test_a_car_that_was_moved_is_fetched_from_where_it_stands() -> None:
    board = fetching()
    assert asked(board, PLACE)
    board.hears(CarAt(STEWARD, TASK, ELSEWHERE.number, 2, 2_700))
    before = asked(board, PLACE)
    board.lives(board.now_us + 10_000_000)
    assert works(board.plans[-1]) == [ELSEWHERE, BAY]
    assert asked(board, PLACE) == before, "nothing is there any more"


def test_where_no_way_leads_to_it_nothing_is_handled_elsewhere() -> None:
    board = fetching()
    board.holon.behaviour.going_around.generation.reroute = lambda *_: None  # type: ignore[attr-defined]  # a robot's, with no way
    board.hears(CarAt(STEWARD, TASK, ELSEWHERE.number, 2, 2_700))
    before = asked(board, PLACE)
    board.lives(board.now_us + 10_000_000)
    assert works(board.plans[-1]) == [PLACE, BAY]
    assert asked(board, PLACE) == before
