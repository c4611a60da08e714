"""What the machines of the system mapd say beyond the messages of all.

Written by ``make docs`` from ``dbc/mapd.dbc``: change that file, never this one.
"""

from enum import IntEnum

from onboard.contract.base import Message, message


class CartAction(IntEnum):
    """Orders to a robot's body."""

    MOVE = 0
    LOAD = 1
    UNLOAD = 2


@message(frozen=True, slots=True)
class StepRound(Message):
    """Step begins: sent when all robots have told that they have come to it.

    Asks for bids for all calls that stand; bids end when the first StepTurn of the step is heard.
    """

    #: The step. 0 to 4194303.
    step: int
    #: How many calls stand: who knows of another number asks the desk. 0 to 65535.
    open_tasks: int
    #: Differs where the round of a step is opened again. 0 to 255.
    attempt: int
    #: Whether bids are asked for; if not, robots go on.
    bidding: bool


@message(frozen=True, slots=True)
class StepTurn(Message):
    """Closes the round of a step.

    One for each robot for which the round has changed anything, or one with changes 0. These plan in this order,
    each after it has heard the paths of those before.
    """

    #: The step. 0 to 4194303.
    step: int
    #: Number of this change, from 0. 0 to 255.
    index: int
    #: How many changes there are. 0 to 255.
    changes: int
    #: Node-ID of the robot, 0 where there are no changes. 0 to 250.
    robot: int
    #: Whether it has won a task: the Award that says which has the lowest 7 bits of the step as its task_version. If
    #: not, it has none now but what is aboard. 0 to 1.
    won: int


@message(frozen=True, slots=True)
class TurnRequest(Message):
    """A robot asks for a turn to plan.

    Others need the place where its path ends, it has no task and would wait better elsewhere, or what it has aboard
    would be there sooner by another path.
    """

    #: The step. 0 to 4194303.
    step: int
    #: That of the StepRound. 0 to 255.
    attempt: int


@message(frozen=True, slots=True)
class PathHead(Message):
    """A path; its moves follow in PathMoves.

    It ends where the robot may stay for ever. An incomplete path is no path.
    """

    #: Step at which the robot is in cell. 0 to 4194303.
    step: int
    #: First cell. 0 to 63999.
    cell: int
    #: Number of moves, one a step. 0 to 4095.
    moves: int
    #: Grows by one with each path of the sender. 0 to 255.
    version: int
    #: Whether the robot found no other path, keeps its former one and has no task but what is aboard.
    kept: bool


@message(frozen=True, slots=True)
class PathMoves(Message):
    """Twelve moves of a path, four bits each.

    0 to wait, n for the n-th of the ways that lead from the cell, in the order of the site file's map (up, left,
    right, down) or lines.
    """

    #: Version of the path. 0 to 255.
    version: int
    #: Number of this frame, from 0. 0 to 255.
    part: int
    #: Moves, the first one in the lowest bits; 0 after the last. 0 to 281474976710655.
    codes: int


@message(frozen=True, slots=True)
class StepState(Message):
    """A robot has come to a step.

    Said again for whoever asks.
    """

    #: The step. 0 to 4194303.
    step: int
    #: Where it is. 0 to 63999.
    cell: int
    #: The task that it has, 65535 for none. 0 to 65535.
    task: int
    #: Whether that is aboard.
    loaded: bool
    #: Whether it was delivered on the way to this step: then the robot has no task any more.
    served: bool
