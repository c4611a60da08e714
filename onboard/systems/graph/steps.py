"""How a robot passes nodes and how it loads there: two tables of (state, event). A pair without a line changes nothing.

The robot's way through one node begins when the node before is behind it, and ends when that one is.
"""

from enum import Enum

from onboard.contract.graph import RobotMode


class Approach(Enum):
    """How far a robot has come with the node ahead of it, or in which it is."""

    AWAY = "on the edge; its sensor has not met the node"
    NEAR = "near or in the node, with no need to ask"
    ASKING = "it has told by which edge it leaves, and waits for an answer"
    STOPPED = "the answer was STOP; it asks again"
    GRANTED = "an edge is granted, and its tokens are asked for or held"


class NodeEvent(Enum):
    """What a robot meets on its way through a node."""

    MET = "the sensor, or the body itself, is at the node"
    PASSED = "another node is ahead"
    ONWARD = "its way leads out of the node"
    STAYS = "its way does not"
    STOP = "the node's agent answers STOP"
    GO = "the node's agent grants an edge, wanted or another (row G16)"
    LAPSED = "the tokens of what was granted did not come in time"


class NodeDeed(Enum):
    """What follows for its signal."""

    NOTHING = "nothing is said"
    SIGNAL = "it tells by which edge it leaves, where that is due or new"
    FORGET = "signal and grant are forgotten"


#: (approach, event) -> (approach that follows, deed).
NODE_TABLE: dict[tuple[Approach, NodeEvent], tuple[Approach, NodeDeed]] = {
    (Approach.AWAY, NodeEvent.MET): (Approach.NEAR, NodeDeed.NOTHING),
    **{(approach, NodeEvent.PASSED): (Approach.AWAY, NodeDeed.FORGET) for approach in Approach},
    (Approach.NEAR, NodeEvent.ONWARD): (Approach.ASKING, NodeDeed.SIGNAL),
    (Approach.ASKING, NodeEvent.ONWARD): (Approach.ASKING, NodeDeed.SIGNAL),
    (Approach.ASKING, NodeEvent.STAYS): (Approach.NEAR, NodeDeed.FORGET),
    (Approach.ASKING, NodeEvent.STOP): (Approach.STOPPED, NodeDeed.NOTHING),
    (Approach.ASKING, NodeEvent.GO): (Approach.GRANTED, NodeDeed.NOTHING),
    (Approach.STOPPED, NodeEvent.ONWARD): (Approach.STOPPED, NodeDeed.SIGNAL),
    (Approach.STOPPED, NodeEvent.STAYS): (Approach.NEAR, NodeDeed.FORGET),
    (Approach.STOPPED, NodeEvent.GO): (Approach.GRANTED, NodeDeed.NOTHING),
    (Approach.GRANTED, NodeEvent.LAPSED): (Approach.NEAR, NodeDeed.FORGET),
}


class Stay(Enum):
    """What errand, place and clock come to for loading (row G13)."""

    NO_ERRAND = "nothing is in hand"
    UNDER_WAY = "its next stop is elsewhere, or a person holds it and it has not begun"
    AT_STOP = "it is at its next stop, and does not load yet"
    LOADING = "it loads, and the site's time for that is not over"
    LOADED = "that time is over"


class StayDeed(Enum):
    """What follows for its load."""

    WAIT = "nothing changes"
    DROP = "no loading is going on"
    BEGIN = "loading begins"
    GO_ON = "the stop is behind it"


#: (mode, stay) -> (mode that follows, deed).
LOAD_TABLE: dict[tuple[RobotMode, Stay], tuple[RobotMode, StayDeed]] = {
    **{(mode, Stay.NO_ERRAND): (RobotMode.FREE, StayDeed.DROP) for mode in RobotMode},
    **{(mode, Stay.UNDER_WAY): (RobotMode.DRIVING, StayDeed.DROP) for mode in RobotMode},
    **{(mode, Stay.AT_STOP): (RobotMode.LOADING, StayDeed.BEGIN) for mode in RobotMode},
    (RobotMode.LOADING, Stay.LOADING): (RobotMode.LOADING, StayDeed.WAIT),
    (RobotMode.LOADING, Stay.LOADED): (RobotMode.LOADING, StayDeed.GO_ON),
}
