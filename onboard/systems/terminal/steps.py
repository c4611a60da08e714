"""What a vehicle does for the elementary action in hand: one table of (action, finding).

The action that follows is its plan's next; the deeds that end one say so.
"""

from enum import Enum

from onboard.contract.terminal import Action


class ActionFinding(Enum):
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


class ActionDeed(Enum):
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
    ActionFinding.AT_WORK: ActionDeed.WAIT,
    ActionFinding.HELD: ActionDeed.WAIT,
    ActionFinding.FAILED: ActionDeed.TELL_FAILURE,
    ActionFinding.READY: ActionDeed.HANDLE,
}

#: (action, finding) -> deed.
TABLE: dict[tuple[Action, ActionFinding], ActionDeed] = {
    (Action.GOTO, ActionFinding.DONE): ActionDeed.END,
    (Action.GOTO, ActionFinding.AT_WORK): ActionDeed.WAIT,
    (Action.GOTO, ActionFinding.OBSTACLE): ActionDeed.TELL_OBSTACLE,
    (Action.GOTO, ActionFinding.HELD): ActionDeed.WAIT,
    (Action.GOTO, ActionFinding.IN_LANE): ActionDeed.NEXT_SLOT,
    (Action.GOTO, ActionFinding.CROSSES_ELSEWHERE): ActionDeed.CROSS,
    (Action.GOTO, ActionFinding.CLOSED): ActionDeed.WAIT,
    (Action.GOTO, ActionFinding.AT_END): ActionDeed.NEXT_ENTITY,
    **{
        (action, finding): deed
        for action in Action
        if action is not Action.GOTO
        for finding, deed in _AT_STATION.items()
    },
    (Action.DOCK, ActionFinding.DONE): ActionDeed.END,
    (Action.PICK_UP, ActionFinding.NO_RIGHT): ActionDeed.ASK_FOR_BOX,
    (Action.PICK_UP, ActionFinding.DONE): ActionDeed.END_ABOARD,
    (Action.PUT_DOWN, ActionFinding.DONE): ActionDeed.END_PUT_DOWN,
    (Action.UNDOCK, ActionFinding.AT_END): ActionDeed.BACK_TO_AREA,
    (Action.UNDOCK, ActionFinding.DONE): ActionDeed.END,
}
