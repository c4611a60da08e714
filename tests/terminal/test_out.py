"""A vehicle that goes on only when a person has come: others pass it where they can, and the desk says who waits."""

from collections.abc import Callable
from functools import partial

import pytest

from bus_sim.faults.injection import parse_injection
from bus_sim.options import RunOptions
from bus_sim.systems.terminal.orders import count as count_of
from bus_sim.systems.terminal.playing import play
from bus_sim.systems.terminal.run import TerminalRun
from tests.terminal.seeds import short


def _missions(boxes: tuple[tuple[str, str], ...], apart_s: int) -> str:
    """One box each, to the station named."""
    texts = [
        f'[[missions]]\nat_s = {5 + number * apart_s}\ntranship = ["{box}"]\nto = "{to}"\n\n'
        for number, (box, to) in enumerate(boxes)
    ]
    return "".join(texts)


_MISSIONS = _missions((("B4", "S4"), ("B3", "S4"), ("B14", "S10"), ("B13", "S10"), ("B7", "S4")), apart_s=0)
#: Twice what all five take where nobody is out.
_LIMIT_US = 400_000_000


def _hold(vehicle: str, at_s: int) -> str:
    return f'[[manual]]\nat_s = {at_s}\nvehicle = "{vehicle}"\ndo = "hold"\n\n'


def _kill(run: TerminalRun, vehicle: str, at_s: int) -> None:
    run.plant.timers.call_at(at_s * 1_000_000, partial(run.crash, run.site.machine(vehicle)))


def _played(
    text: str, then: Callable[[TerminalRun], None] = lambda _: None, missions: str = _MISSIONS
) -> tuple[int, list[str]]:
    """How many boxes came to where they were wanted, and what the desk said of the others, as it was said."""
    runs = list[TerminalRun]()

    def prepare(run: TerminalRun) -> None:
        runs.append(run)
        then(run)

    play(short(missions + text), RunOptions(seed=1), limit_us=_LIMIT_US, prepare=prepare)
    lines = [text for _, source, text in runs[0].log.lines if source in ("Desk", "Quay") and " waits: " in text]
    return count_of(runs[0].plant).served, lines


@pytest.mark.parametrize("vehicle", ["R1", "R2"])
def test_what_a_vehicle_that_is_held_for_good_has_not_begun_others_do_past_it(vehicle: str) -> None:
    """No box of the five came, as all waited for the one that was to go first."""
    assert _played(_hold(vehicle, 30)) == (5, [])


def test_so_they_do_where_its_controller_is_off_for_good() -> None:
    assert _played("", lambda run: _kill(run, "R2", 30)) == (5, [])


def test_whose_controller_comes_back_late_leaves_to_others_what_they_were_given_meanwhile() -> None:
    def off(run: TerminalRun) -> None:
        _kill(run, "R2", 30)
        run.plant.timers.call_at(110_000_000, partial(run.start_controller, run.site.machine("R2")))

    assert _played("", off) == (5, [])


@pytest.mark.parametrize(("vehicle", "at_s"), [("R4", 10), ("R1", 40), ("R3", 35)])
def test_who_waits_at_a_stack_for_a_box_under_one_that_was_given_back_leaves_it(vehicle: str, at_s: int) -> None:
    """Nobody could come to that stack any more, and one to three of five boxes were all that came (drawn 779)."""
    below = (("B4", "S4"), ("B3", "S10"), ("B2", "S4"), ("B7", "S4"), ("B6", "S10"))
    held = _hold(vehicle, at_s) + _hold(vehicle, at_s + 150).replace("hold", "release")
    served, _ = _played(held, missions=_missions(below, apart_s=1))
    assert served == 5


@pytest.mark.parametrize(("vehicle", "at_s"), [("R1", 25), ("R4", 15)])
def test_what_a_desk_that_is_cut_off_gives_to_others_is_fetched_once_all_the_same(vehicle: str, at_s: int) -> None:
    """Boxes by their type: who came back with its old plan took one more, and another mission got one too few (881).

    R1 made its plan anew as it came into a lane, from the area behind it, and stood in that lane for good.
    """
    missions = "".join(
        f'[[missions]]\nat_s = 5\nload = {count}\ntype = "{type_}"\nfrom = "A4"\nto = "{to}"\n\n'
        for count, type_, to in ((3, "T1", "S10"), (2, "T2", "S4"))
    )
    fault = parse_injection(f"partition:members=Desk|Quay|{vehicle},at_s={at_s},for_s=200,way=both")
    runs = list[TerminalRun]()
    play(short(missions), RunOptions(seed=1, faults=(fault,)), limit_us=900_000_000, prepare=runs.append)
    plant = runs[0].plant
    assert (count_of(plant).served, len(plant.world.handled)) == (5, 2 * 5)


def test_what_is_aboard_stays_there_and_the_desk_says_who_has_it() -> None:
    served, told = _played(_hold("R3", 45))
    assert served == 3
    assert set(told) == {
        "box B14 waits: R3, which is to bring it, does not go on",
        "mission 4 waits: nobody can do it before R3 goes on",
    }
    assert len(told) == 2


def test_who_cannot_pass_a_crossing_waits_and_the_desk_says_for_whom() -> None:
    served, told = _played(_hold("R1", 50))
    assert served == 0, "all ways lead over the crossing"
    aboard = {
        f"box {box} waits: {one}, which is to bring it, cannot pass R1" for box, one in (("B14", "R3"), ("B4", "R4"))
    }
    assert set(told) == aboard | {f"mission {number} waits: no vehicle goes on (R1)" for number in (2, 4, 5)}


def test_missions_for_which_no_vehicle_is_left_are_told_of_once() -> None:
    served, told = _played("".join(_hold(one, 2) for one in ("R1", "R2", "R3", "R4")))
    assert served == 0
    assert sorted(told) == [f"mission {number} waits: no vehicle goes on (R1, R2, R3, R4)" for number in range(1, 6)]


def test_who_is_taken_through_its_plan_step_by_step_gives_nothing_back() -> None:
    """A step each forty seconds: the box is that vehicle's all the while, and it brings it."""
    presses = "".join(_hold("R4", at_s).replace("hold", "step") for at_s in range(50, 590, 40))
    runs = list[TerminalRun]()
    text = _missions((("B7", "S4"),), apart_s=0) + _hold("R4", 12) + presses
    play(short(text), RunOptions(seed=1), limit_us=700_000_000, prepare=runs.append)
    assert [one.vehicle for one in runs[0].plant.world.handled] == [14, 14]


def test_a_vehicle_that_is_let_go_soon_changes_no_plan() -> None:
    release = _hold("R2", 50).replace("hold", "release")
    assert _played(_hold("R2", 30) + release) == (5, [])
