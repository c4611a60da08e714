"""What a lathe says of an order that was taken back while it was off: its journal's word, until the desk answers."""

from operator import itemgetter

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import CallResult, KindCode, MachineState, Reason, TaskPhase
from onboard.contract.messages import Award, Halted, Heartbeat, Message, Reference, TaskReport
from tests.faults.systems import judged

DESK, FIRST, SECOND = 9, 1, 2
TASK = Reference(DESK, 1)


TAKEN_BACK = Award(DESK, 1, 0, TASK, 1, CallResult.REJECTED, Reason.NODE_SILENT)


def beat(boot: int) -> Heartbeat:
    digest = find_site("turning").digest
    return Heartbeat(FIRST, 1, digest, 0xFFFF, boot, KindCode.LATHE, MachineState.WORKING, 0)


def has(node: int, phase: TaskPhase = TaskPhase.AWARDED) -> TaskReport:
    return TaskReport(node, TASK, phase, 0, Reason.NONE)


def log(boot: int, phase: TaskPhase) -> list[tuple[int, Message]]:
    """The first has an order, it is taken back and goes to the second; the first speaks of it in life ``boot``."""
    said = [beat(1), has(FIRST), TAKEN_BACK, has(SECOND), beat(boot), has(FIRST, phase)]
    return [(1_000_000 * number, one) for number, one in enumerate(said, start=1)]


def cut_off(back_s: int, *claims: tuple[int, TaskPhase]) -> list[tuple[int, Message]]:
    """The first is not heard from the second second on, its order is taken back at 10 s; it speaks at those seconds."""
    said = [(1, beat(1)), (2, has(FIRST)), (10, TAKEN_BACK), (11, has(SECOND)), (back_s, beat(1))]
    return [(1_000_000 * at_s, one) for at_s, one in [*said, *[(at_s, has(FIRST, phase)) for at_s, phase in claims]]]


@pytest.mark.parametrize(
    ("boot", "phase", "is_found"),
    [(2, TaskPhase.AWARDED, False), (1, TaskPhase.AWARDED, True), (2, TaskPhase.DONE, True)],
    ids=["started again", "heard it", "did it all the same"],
)
def test_only_who_was_off_may_tell_that_it_has_an_order_of_another(boot: int, phase: TaskPhase, is_found: bool) -> None:
    found = {one.rule for one in judged(find_site("turning"), log(boot, phase)).findings}
    assert ("one-lathe" in found) is is_found


@pytest.mark.parametrize(
    ("claims", "is_found"),
    [
        ([(31, TaskPhase.AWARDED)], False),
        ([(31, TaskPhase.AWARDED), (33, TaskPhase.AWARDED)], False),
        ([(31, TaskPhase.AWARDED), (40, TaskPhase.AWARDED)], True),
        ([(31, TaskPhase.DONE)], True),
    ],
    ids=["once", "a word was lost", "has been told for long", "did it all the same"],
)
def test_who_was_cut_off_as_it_was_taken_back_has_patience_for_one_answer(
    claims: list[tuple[int, TaskPhase]], is_found: bool
) -> None:
    found = {one.rule for one in judged(find_site("turning"), cut_off(30, *claims)).findings}
    assert ("one-lathe" in found) is is_found


@pytest.mark.parametrize(("boot", "is_found"), [(2, False), (1, True)], ids=["started again", "never off"])
def test_so_may_who_had_won_it_and_was_off_before_it_could_say_so(boot: int, is_found: bool) -> None:
    won = Award(DESK, 1, FIRST, TASK, 1, CallResult.AWARDED, Reason.NONE)
    said = [beat(1), won, TAKEN_BACK, has(SECOND), beat(boot), has(FIRST)]
    story: list[tuple[int, Message]] = [(1_000_000 * number, one) for number, one in enumerate(said, start=1)]
    found = {one.rule for one in judged(find_site("turning"), story).findings}
    assert ("one-lathe" in found) is is_found


@pytest.mark.parametrize("is_silent", [True, False])
def test_who_is_cut_off_ends_the_order_that_it_has(is_silent: bool) -> None:
    """Neither it nor its desk can know (drawn turning cell 108): the parts are there twice."""
    named = Halted(DESK, FIRST, Reason.NODE_SILENT, 0, needs_person=False, boot=1)
    others = [(1_000_000 * at_s, named) for at_s in range(8, 40, 2)] if is_silent else []
    said = (12, TaskPhase.AWARDED), (35, TaskPhase.DONE), (52, TaskPhase.AWARDED), (52, TaskPhase.DONE)
    made: list[tuple[int, Message]] = [*cut_off(50, *said), *others]
    found = {one.rule for one in judged(find_site("turning"), sorted(made, key=itemgetter(0))).findings}
    assert ("one-lathe" in found) is not is_silent
