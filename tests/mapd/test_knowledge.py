"""What is open, and who comes to a cell first, as a machine hears it."""

from onboard.contract.mapd import PathHead, StepState
from onboard.systems.mapd.calls import call_of
from onboard.systems.mapd.fields import NO_TASK
from onboard.systems.mapd.floor import grid_floor
from onboard.systems.mapd.knowledge import Knowledge
from onboard.systems.mapd.paths import Path
from onboard.systems.mapd.tasks import TransportTask

DESK, ONE, TWO = 1, 2, 3


def knowing(count: int) -> Knowledge:
    """A machine that knows of two robots and ``count`` tasks, from cell n to cell n + 1."""
    known = Knowledge(grid_floor(["....."]), (ONE, TWO), ONE)
    for number in range(count):
        known.on_call(call_of(DESK, TransportTask(number, 0, number, number + 1), 400_000))
    return known


def numbers(known: Knowledge) -> list[int]:
    return [task.number for task in known.open_tasks]


def test_what_is_open_goes_by_all_that_was_heard_last() -> None:
    known = knowing(3)
    assert numbers(known) == [0, 1, 2] and known.wanted_cells == {0, 1, 2, 3}
    known.on_state(StepState(TWO, 1, 1, 1, True, False))
    assert numbers(known) == [0, 2], "one is aboard"
    assert known.wanted_cells == {0, 1, 2, 3}, "it is still to be brought"
    known.on_state(StepState(TWO, 2, 2, 1, False, True))
    assert numbers(known) == [0, 2] and known.wanted_cells == {0, 1, 2, 3}
    known.taken[TWO] = 2
    assert numbers(known) == [0], "its robot stands beside it"
    known.on_state(StepState(TWO, 3, 2, NO_TASK, False, False))
    assert numbers(known) == [0, 2], "and went on without it"
    known.on_call(call_of(DESK, TransportTask(4, 0, 3, 4), 400_000))
    assert numbers(known) == [0, 2, 4] and 4 in known.wanted_cells


def test_a_task_that_is_dated_anew_is_bid_for_by_its_date() -> None:
    known = knowing(1)
    assert [task.release for task in known.open_tasks] == [0]
    known.on_round(7, 400)
    assert [task.release for task in known.open_tasks] == [7]


def test_who_is_asked_again_forgets_what_nobody_has_aboard() -> None:
    known = knowing(2)
    known.on_state(StepState(TWO, 1, 1, 1, True, False))
    assert numbers(known) == [0]
    known.forget_open()
    assert numbers(known) == [] and known.wanted_cells == {2}


def test_the_first_in_a_cell_is_told_from_each_robots_own_step_on() -> None:
    known = knowing(0)
    known.put(PathHead(ONE, 0, 0, 2, 1, False), Path(0, (0, 1, 2)))
    known.put(PathHead(TWO, 0, 3, 4, 1, False), Path(0, (3, 3, 3, 3, 4)))
    assert known.next_user(1) == ONE
    assert known.next_user(3) == TWO and known.next_user(0) == ONE
    assert known.next_user(0, leaving=ONE) == ONE, "it has told no step"
    known.on_state(StepState(ONE, 0, 0, NO_TASK, False, False))
    assert known.next_user(0) == ONE and known.next_user(0, leaving=ONE) is None
    known.on_state(StepState(ONE, 2, 2, NO_TASK, False, False))
    assert known.next_user(1) is None, "it was there"
