"""What stays with people: what is moved aside for a buried box (row M08), and a hand in a vehicle (row M38)."""

from collections.abc import Callable
from functools import partial

import pytest

from bus_sim.options import RunOptions
from bus_sim.systems.terminal.playing import play
from bus_sim.systems.terminal.run import TerminalOutcome, TerminalRun
from onboard.config.problems import ConfigError
from onboard.contract.codes import ManualMode
from onboard.contract.messages import Bid, CallForProposals, ManualState, Message
from onboard.contract.terminal import StepReport, StepResult
from tests.terminal.seeds import short

Said = list[tuple[int, Message]]
#: Who wins the mission of the scenes by hand, where nobody has a hand in it.
WINNER = "R4"

_BURIED = """
[[missions]]
at_s = 5
tranship = ["B2"]
to = "S4"

[[missions]]
at_s = 60
desk = "Quay"
tranship = ["B4", "B3"]
to = "S4"
"""


def _keep(run: TerminalRun, runs: list[TerminalRun], said: list[tuple[int, Message]]) -> None:
    runs.append(run)
    run.observers.append(lambda message, time_us: said.append((time_us, message)))


def test_m08_nobody_clears_a_stack_that_no_mission_names() -> None:
    site, runs, said = short(_BURIED), list[TerminalRun](), list[tuple[int, Message]]()
    outcome = play(site, RunOptions(seed=1), limit_us=600_000_000, prepare=partial(_keep, runs=runs, said=said))
    calls = [(time_us, one.car.number) for time_us, one in said if isinstance(one, CallForProposals)]
    assert min(time_us for time_us, _ in calls) >= 60_000_000, "something moves before anybody ordered it"
    names = [site.boxes[box - 1].name for _, box in calls]
    assert names.index("B4") < names.index("B3") < names.index("B2")
    assert outcome.is_good
    told = [text for _, source, text in runs[0].log.lines if source == "Desk" and "waits" in text]
    assert told == ["box B2 waits: B4 is above it, and nobody ordered that away"]


_BY_HAND = """
[[missions]]
at_s = 5
tranship = ["B4"]
to = "S4"
"""
_PRESSES = [(12, "hold"), (40, "step"), (60, "step"), (80, "step"), (120, "release")]


def _steps(said: list[tuple[int, Message]], vehicle: int) -> list[float]:
    """When a vehicle reported elementary actions as done, s; repeats left out."""
    done: dict[tuple[int, int], int] = {}
    for time_us, one in said:
        if isinstance(one, StepReport) and one.sender == vehicle and one.result is StepResult.DONE:
            done.setdefault((one.version, one.step), time_us)
    return [time_us / 1e6 for time_us in done.values()]


def _by_hand(
    presses: list[tuple[int, str]], prepare: Callable[[TerminalRun], None] | None = None
) -> tuple[TerminalOutcome, Said]:
    said: Said = []
    text = _BY_HAND + "".join(
        f'[[manual]]\nat_s = {at_s}\nvehicle = "{WINNER}"\ndo = "{what}"\n\n' for at_s, what in presses
    )

    def both(run: TerminalRun) -> None:
        run.observers.append(lambda message, time_us: said.append((time_us, message)))
        if prepare is not None:
            prepare(run)

    return play(short(text), RunOptions(seed=1), limit_us=600_000_000, prepare=both), said


def test_m38_a_person_holds_a_vehicle_steps_it_and_lets_it_go() -> None:
    outcome, said = _by_hand(_PRESSES)
    assert outcome.is_good
    node = short(_BY_HAND).machine(WINNER).node_id
    steps = _steps(said, node)
    # What it was about is ended; then nothing until a step by hand, then one action each time, then all the rest.
    assert not [at for at in steps if 25 < at < 40]
    assert [sum(low <= at < low + 20 for at in steps) for low in (40, 60, 80)] == [1, 1, 1]
    assert not [at for at in steps if 100 < at < 120]
    assert len([at for at in steps if at > 120]) >= 3
    modes = [one.manual_mode for _, one in said if isinstance(one, ManualState) and one.sender == node]
    assert list(dict.fromkeys(modes)) == [ManualMode.HELD, ManualMode.STEP, ManualMode.AUTOMATIC]


def test_m38_a_held_vehicle_bids_for_nothing_and_stays_held_over_a_restart() -> None:
    def cut(run: TerminalRun) -> None:
        machine = run.site.machine(WINNER)
        run.plant.timers.call_at(3_500_000, partial(run.crash, machine))
        run.plant.timers.call_at(4_500_000, partial(run.start_controller, machine))

    outcome, said = _by_hand([(2, "hold")], cut)
    assert outcome.is_good, "another one does it"
    node = short(_BY_HAND).machine(WINNER).node_id
    assert not [one for _, one in said if isinstance(one, Bid) and one.sender == node]
    assert not _steps(said, node)


def test_m38_a_mistake_in_a_hand_is_one_line() -> None:
    for line, word in (
        ('do = "push"', "nothing that one can do by hand"),
        ('vehicle = "R9"', "no vehicle of this name"),
    ):
        key = line.split()[0]
        good = {"do": 'do = "hold"', "vehicle": 'vehicle = "R1"'} | {key: line}
        with pytest.raises(ConfigError, match=word):
            short(_BY_HAND + "[[manual]]\nat_s = 1\n" + "\n".join(good.values()) + "\n")
