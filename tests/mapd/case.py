"""Pick-up and delivery, for the tests of every system."""

from onboard.contract.mapd import PathHead, PathMoves, StepRound, StepState
from onboard.contract.messages import Bid, Message
from onboard.systems.mapd.calls import award_of, call_of
from onboard.systems.mapd.fields import NO_TASK
from onboard.systems.mapd.tasks import TransportTask
from tests.conformance.case import Case
from tests.mapd.sites import drawn, made, site_text


def at(robot: int, step: int, cell: int, task: int = NO_TASK, *, loaded: bool = False, served: bool = False) -> Message:
    """Where a robot says that it is."""
    return StepState(robot, step, cell, task, loaded, served)


def _path(robot: int, cell: int, *codes: int, step: int = 0) -> list[Message]:
    told = sum(code << 4 * place for place, code in enumerate(codes))
    moves: list[Message] = [PathMoves(robot, 1, 0, told)] if codes else []
    return [PathHead(robot, step, cell, len(codes), 1, False), *moves]


CALL = call_of(1, TransportTask(3, 0, 12, 15), 0)
_ROUND = StepRound(1, 0, 1, 0, True)
CASE = Case(
    system="mapd",
    site=site_text(4, drawn(8, 5)),
    busy=lambda: made(6, drawn(16, 1)),
    struck_s=lambda _: (4.0, 28.64),
    limit_s=300,
    parties=None,
    broken={
        "one-a-cell": [
            [at(11, 0, 5), at(12, 0, 5)],
            [at(11, 0, 5), at(12, 0, 6), at(11, 1, 6), at(12, 1, 5)],
            [at(11, 0, 5), at(11, 1, 7)],
            [at(11, 0, 5), at(12, 0, 8), at(11, 1, 5), at(11, 2, 5)],
        ],
        "task-once": [
            [CALL, at(11, 0, 12, 3, loaded=True), at(12, 0, 11, 3, loaded=True)],
            [CALL, at(11, 0, 11, 3, loaded=True)],
            [CALL, at(11, 4, 15, 3, served=True), at(12, 5, 15, 3, served=True)],
            [CALL, at(11, 4, 16, 3, served=True)],
        ],
        "rounds-go-down": [
            [_ROUND, Bid(11, 1, 4, 50, 0), Bid(12, 1, 4, 70, 0)],
            [_ROUND, Bid(11, 1, 4, 50, 0), award_of(1, 0, 12, 3)],
            [_ROUND, Bid(11, 1, 4, 50, 1)],
        ],
        "paths-apart": [
            [*_path(11, 0, 1, 2), *_path(12, 2)],
            [*_path(11, 0, 1), *_path(12, 1, 1)],
            _path(11, 9, 3),
        ],
    },
    words=(
        ["transport task 0", " steps", ", finished"],
        ["delivers task", "goes to pick up task"],
        ["token cell "],
    ),
    drawn=["columns", "rows", "R1"],
)
