"""What a lathe says of an order that was taken back while it was off: its journal's word, until the desk answers."""

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import CallResult, KindCode, MachineState, Reason, TaskPhase
from onboard.contract.messages import Award, Heartbeat, Message, Reference, TaskReport
from tests.faults.systems import judged

DESK, FIRST, SECOND = 9, 1, 2
TASK = Reference(DESK, 1)


def log(boot: int, phase: TaskPhase) -> list[tuple[int, Message]]:
    """The first has an order, it is taken back and goes to the second; the first speaks of it in life ``boot``."""
    digest = find_site("turning").digest

    def beat(of: int) -> Heartbeat:
        return Heartbeat(FIRST, 1, digest, 0xFFFF, of, KindCode.LATHE, MachineState.WORKING, 0)

    def has(node: int, phase: TaskPhase = TaskPhase.AWARDED) -> TaskReport:
        return TaskReport(node, TASK, phase, 0, Reason.NONE)

    taken_back = Award(DESK, 1, 0, TASK, 1, CallResult.REJECTED, Reason.NODE_SILENT)
    said = [beat(1), has(FIRST), taken_back, has(SECOND), beat(boot), has(FIRST, phase)]
    return [(1_000_000 * number, one) for number, one in enumerate(said, start=1)]


@pytest.mark.parametrize(
    ("boot", "phase", "is_found"),
    [(2, TaskPhase.AWARDED, False), (1, TaskPhase.AWARDED, True), (2, TaskPhase.DONE, True)],
    ids=["started again", "heard it", "did it all the same"],
)
def test_only_who_was_off_may_tell_that_it_has_an_order_of_another(boot: int, phase: TaskPhase, is_found: bool) -> None:
    found = {one.rule for one in judged(find_site("turning"), log(boot, phase)).findings}
    assert ("one-lathe" in found) is is_found
