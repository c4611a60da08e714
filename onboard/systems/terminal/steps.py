"""What a vehicle does for the elementary action in hand: one table of (action, finding).

The action that follows is its plan's next; the deeds that end one say so.
"""

from enum import Enum

from onboard.contract.terminal import Action


class Finding(Enum):
    """What drive, handler, rights and mirror come to, for the action in hand; of several the first that holds."""

    NO_RIGHT = "the right to the box is with another"
    DONE = "the devices say that the action is over"
    AT_WORK = "a device is at it, or waits before it tries again"
    OBSTACLE = "the drive has met an obstacle, which is news"
    HELD = "a person lets nothing begin"
    IN_LANE = "slots of the lane are still ahead"
    CROSSES_ELSEWHERE = "the area is not being crossed to where the plan leads next"
    CLOSED = "the next entity is blocked"
    AT_END = "only the way into the next entity is left"
    FAILED = "the handler has failed, which is news"
    READY = "the handler can begin"


class Deed(Enum):
    """What the vehicle does then, and with what effect."""

    WAIT = "nothing"
    END = "report the action, and take up the next"
    END_ABOARD = "state that the box is aboard, report, and take up the next"
    END_PUT_DOWN = "journal and state where the box is, give its right away, report, and take up the next"
    TELL_OBSTACLE = "report that it is blocked"
    TELL_FAILURE = "report that the handler failed, and try again later"
    NEXT_SLOT = "ask for the next slot of the lane, and go there"
    CROSS = "cross the area towards what comes next"
    NEXT_ENTITY = "ask for a slot of what comes next, and go there"
    BACK_TO_AREA = "ask for the bay of the area, and go back there"
    ASK_FOR_BOX = "ask for the right to the box"
    HANDLE = "order the handler"


#: At a station all actions of the handler go alike.
_AT_STATION = {
    Finding.AT_WORK: Deed.WAIT,
    Finding.HELD: Deed.WAIT,
    Finding.FAILED: Deed.TELL_FAILURE,
    Finding.READY: Deed.HANDLE,
}

#: (action, finding) -> deed.
TABLE: dict[tuple[Action, Finding], Deed] = {
    (Action.GOTO, Finding.DONE): Deed.END,
    (Action.GOTO, Finding.AT_WORK): Deed.WAIT,
    (Action.GOTO, Finding.OBSTACLE): Deed.TELL_OBSTACLE,
    (Action.GOTO, Finding.HELD): Deed.WAIT,
    (Action.GOTO, Finding.IN_LANE): Deed.NEXT_SLOT,
    (Action.GOTO, Finding.CROSSES_ELSEWHERE): Deed.CROSS,
    (Action.GOTO, Finding.CLOSED): Deed.WAIT,
    (Action.GOTO, Finding.AT_END): Deed.NEXT_ENTITY,
    **{
        (action, finding): deed
        for action in Action
        if action is not Action.GOTO
        for finding, deed in _AT_STATION.items()
    },
    (Action.DOCK, Finding.DONE): Deed.END,
    (Action.PICK_UP, Finding.NO_RIGHT): Deed.ASK_FOR_BOX,
    (Action.PICK_UP, Finding.DONE): Deed.END_ABOARD,
    (Action.PUT_DOWN, Finding.DONE): Deed.END_PUT_DOWN,
    (Action.UNDOCK, Finding.AT_END): Deed.BACK_TO_AREA,
    (Action.UNDOCK, Finding.DONE): Deed.END,
}
