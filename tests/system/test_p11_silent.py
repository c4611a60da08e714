"""Row P11: at the deadline all know the winner, and nobody says so: a word in the site file, on a shipped site."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

import bus_sim.sites
from bench.negotiation import PROTOCOLS, measure
from bus_sim.options import RunOptions
from bus_sim.run import BusRun
from bus_sim.session import play
from bus_sim.systems.car_park.day import ParkingDay
from onboard.config.site import parse_site
from onboard.contract.codes import CallResult, KindCode
from onboard.contract.messages import Award, Bid, CallForProposals, Message, TaskReport
from tests.cut import shown

SMALL = (Path(bus_sim.sites.__file__).parent / "small.toml").read_text(encoding="utf-8")


def silent_run() -> list[Message]:
    """All that three customers' cars make the machines say, in and out."""
    site = parse_site(f'{SMALL}\n[timing]\naward = "silent"\n', "small.toml")
    said: list[Message] = []

    def listen(run: BusRun[Any]) -> None:
        run.observers.append(lambda message, _: said.append(message))

    day = ParkingDay(random_s=(60.0, 10.0), cars=3)
    played = play(site, RunOptions(demand=day, quiet=True), prepare=listen)
    assert played.is_good
    return said


def awards(messages: Sequence[Message]) -> list[Award]:
    return [one for one in messages if isinstance(one, Award) and one.result is CallResult.AWARDED]


def test_p11_a_site_whose_file_says_so_works_without_a_single_award() -> None:
    silent = silent_run()
    assert not awards(silent)

    def check(messages: Sequence[Message]) -> None:
        best: dict[tuple[int, int], tuple[int, int]] = {}
        taken = {(one.task, one.sender) for one in messages if isinstance(one, TaskReport)}
        for one in messages:
            if isinstance(one, Bid):
                best[one.initiator, one.call] = min(
                    best.get((one.initiator, one.call), (1 << 32, 0)), (one.cost, one.sender)
                )
        calls = [one for one in messages if isinstance(one, CallForProposals) and one.kind is KindCode.ROBOT]
        won = [(one.task, best[one.sender, one.call][1]) for one in calls if (one.sender, one.call) in best]
        assert len({task for task, _ in won}) >= 6
        assert all(one in taken for one in won)

    shown(check, silent, CallForProposals, Bid, TaskReport)


@pytest.mark.parametrize(("award", "two"), [("MIP", False), ("MIP, silent", True)])
def test_p11_a_frame_that_one_receiver_misses_makes_two_winners_without_an_award(award: str, two: bool) -> None:
    tally = measure(PROTOCOLS[award], 5, 30, loss=0.05)
    assert (tally.doubled > 0) is two
    if not two:
        assert (tally.unserved, tally.misnamed) == (0, 0)
