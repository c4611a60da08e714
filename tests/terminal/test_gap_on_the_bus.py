"""Row M26, from the bus: one box after the other is not the best order of all, and not far from it."""

from collections.abc import Sequence

from bus_sim.options import RunOptions
from bus_sim.systems.terminal.playing import play
from onboard.contract.messages import Award, Bid, CallForProposals, CarAt
from onboard.contract.terminal import PlanHead
from onboard.systems.terminal.site import Terminal
from tests.cut import Timed, shown_at
from tests.terminal.seeds import short

#: From the first plan's begin to the last one's end, ms: of the best of all orders and assignments, planned by the same
#: search (tests/terminal/test_planning.py), and of what the fleet does, to the second.
BEST_MS, FLEET_MS = 184_000, 207_000
BOXES = {"B4": "S1", "B7": "S4", "B14": "S1", "B13": "S10"}


def boxes_and_two_vehicles() -> tuple[Terminal, list[Timed]]:
    """The shipped network with R3 and R4 alone; four boxes, each to its station, ordered at once."""
    missions = (f'\n[[missions]]\nat_s = 5\ntranship = ["{box}"]\nto = "{to}"\n' for box, to in BOXES.items())
    site = short("".join(missions))
    heard: list[Timed] = []
    outcome = play(
        site,
        RunOptions(seed=1, quiet=True, without=frozenset({"R1", "R2"})),
        limit_us=300_000_000,
        noise=0,
        prepare=lambda run: run.observers.append(lambda message, at_us: heard.append((at_us, message))),
    )
    assert outcome.is_good
    return site, heard


def test_m26_two_vehicles_and_four_boxes_take_an_eighth_longer_than_the_best_order_of_all() -> None:
    site, heard = boxes_and_two_vehicles()
    wanted = {(box, site.by_name[to].number) for box, to in BOXES.items()}

    def check(said: Sequence[Timed]) -> None:
        calls = {(one.sender, one.call) for _, one in said if isinstance(one, CallForProposals)}
        bids = {(one.initiator, one.call, one.sender): one.cost for _, one in said if isinstance(one, Bid)}
        won = [one for _, one in said if isinstance(one, Award) and one.winner]
        assert {(one.sender, one.call) for one in won} <= calls and len({one.task for one in won}) == len(BOXES)
        assert {one.winner for one in won} == {13, 14}
        begins = [one.begin_ms for _, one in said if isinstance(one, PlanHead) and one.version == 1]
        ends = [bids[one.sender, one.call, one.winner] for one in won if (one.sender, one.call, one.winner) in bids]
        assert begins and len(ends) == len(won)
        # What was bid is what comes: the last box lies where it shall two seconds before its vehicle has undocked.
        lies = {(site.boxes[one.car.number - 1].name, one.station): at for at, one in said if isinstance(one, CarAt)}
        assert wanted <= lies.keys()
        assert 1_500 < max(ends) - max(lies[one] for one in wanted) // 1000 < 2_500
        assert abs(max(ends) - min(begins) - FLEET_MS) < 1_000
        assert BEST_MS < max(ends) - min(begins) < BEST_MS * 9 // 8 + 1_000

    shown_at(check, heard, CallForProposals, Bid, Award, PlanHead, CarAt)
