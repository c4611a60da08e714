"""Row P53: automatic piloting, with the frequency of inputs and that of outputs apart, as the bus shows them."""

import statistics
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import pytest

from bus_sim.cli import main
from bus_sim.options import RunOptions
from bus_sim.run import BusRun
from bus_sim.session import play
from bus_sim.sites import find_site
from bus_sim.systems.car_park.day import ParkingDay
from onboard.contract.codes import Operation
from onboard.contract.messages import CallForProposals, Message
from tests.cut import shown


def test_p53_cars_come_and_are_fetched_each_at_its_own_frequency() -> None:
    day = ParkingDay(random_s=(300.0, 20.0), random_out_s=(480.0, 10.0), cars=10)
    said: list[Message] = []
    times: dict[int, int] = {}

    def listen(run: BusRun[Any]) -> None:
        def note(message: Message, now_us: int) -> None:
            if isinstance(message, CallForProposals):
                said.append(message)
                times[id(message)] = now_us

        run.observers.append(note)

    play(find_site("level1"), RunOptions(demand=day, quiet=True), prepare=listen)

    def check(messages: Sequence[Message]) -> None:
        first: dict[tuple[Operation, object], int] = {}
        for one in messages:
            if isinstance(one, CallForProposals) and one.operation in (Operation.PARK, Operation.RETRIEVE):
                first.setdefault((one.operation, one.car), times[id(one)])
        for operation, mean_s in ((Operation.PARK, 300), (Operation.RETRIEVE, 480)):
            called = sorted(time_us for (kind, _), time_us in first.items() if kind is operation)
            gaps_s = [(later - earlier) / 1e6 for earlier, later in pairwise(called)]
            assert len(gaps_s) >= 5
            assert statistics.median(gaps_s) == pytest.approx(mean_s, abs=20)

    shown(check, said, CallForProposals)


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["--random-out", "60", "20"], "--random-out: departures alone; say with --random how cars arrive"),
        (["--random", "60", "20", "--random-out", "0", "1"], "--random-out: mean 0 s: must be above 0"),
    ],
)
def test_p53_a_mistake_in_the_frequencies_is_one_line(
    words: list[str], line: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "level1", *words]) == 2
    assert line in capsys.readouterr().err
