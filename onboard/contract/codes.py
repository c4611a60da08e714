"""Value tables shared by every message.

Written by ``make docs`` from ``dbc/fleet.dbc`` and ``dbc/device.dbc``: change that file, never this one.
"""

from enum import IntEnum

#: The contract of dbc/fleet.dbc.
CONTRACT = 2
#: What heartbeats say of it; a machine with another number joins as an obstacle and never bids. While the
#: contract is open: 128 plus the low 7 bits of a CRC-32 over the DBC (docs/protocol.md), so that builds
#: of different days are strangers.
CONTRACT_VERSION = 0xDF


class Reason(IntEnum):
    """Why something was held, refused or dropped; the one table for all messages."""

    NONE = 0
    NO_BID = 1
    PARK_FULL = 2
    CAR_TOO_LARGE = 3
    UNKNOWN_TICKET = 4
    TOKEN_HELD_BY_OTHER = 5
    TOKEN_NOT_GRANTABLE_YET = 6
    TOKEN_STALE_VERSION = 7
    NOT_AUTHORISED = 8
    MIRROR_BEHIND = 9
    OTHER_CONTRACT = 10
    OTHER_SITE = 11
    BUS_TIME_LOST = 12
    POSITION_UNKNOWN = 13
    JOURNAL_LOST = 14
    ACTUATOR_FAULT = 15
    SENSOR_FAULT = 16
    INVARIANT_BROKEN = 17
    INCOMPLETE_SET = 18
    UNKNOWN_IDENTIFIER = 19
    SHORT_FRAME = 20
    VALUE_OUT_OF_RANGE = 21
    DUPLICATE_NODE_ID = 22
    LATE = 23
    QUEUE_FULL = 24
    CANCELLED = 25
    OPERATOR = 26
    DOOR_NOT_READY = 27
    BEATEN = 28
    IMPOSSIBLE = 29
    PERSON_INSIDE = 30
    NODE_SILENT = 31
    NOT_OF_SITE = 32
    NOT_OF_KIND = 33
    NOT_THE_HOLDER = 34
    RIGHT_CLAIMED = 35
    EMERGENCY_STOP = 36
    LEFT_OUT = 37
    OTHER_EPOCH = 38
    JOURNAL_SHORT = 39
    JOURNAL_FOREIGN = 40
    NO_FRESH_PROOF = 41
    RUNAWAY = 42
    WATCHDOG = 43
    BUS_LOST = 44
    CLOCK_JUMPED = 45
    FALSE_STATEMENT = 46
    REGENERATION = 47


class TokenKind(IntEnum):
    """What a token authorises.

    Its 24-bit number means a segment, a station, a car or a task accordingly, or segments in line.
    """

    SEGMENT = 0
    STATION = 1
    CAR = 2
    TASK = 3
    RUN = 4


class Operation(IntEnum):
    """What a call asks for."""

    PARK = 0
    RETRIEVE = 1
    RIDE = 2
    GIVE_WAY = 3
    RECEIVE = 4
    TRANSPORT = 5
    REACH = 6
    MACHINE = 7


class KindCode(IntEnum):
    """Kinds of machine, as a call addresses them and a heartbeat announces them."""

    ANY = 0
    ROBOT = 1
    LIFT = 2
    COMPARTMENT = 3
    OBSERVER = 4
    VEHICLE = 5
    DESK = 6
    NODE = 7
    ARM = 8
    LATHE = 9


class Criterion(IntEnum):
    """What the number in a bid means; the same for all participants of a call."""

    FINISH_TIME = 0
    MONEY = 1
    LENGTH = 2


class CallResult(IntEnum):
    """How the initiator closed a call."""

    AWARDED = 0
    REOPENED = 1
    REFUSED = 2
    WITHDRAWN = 3
    REJECTED = 4
    OPTION = 5


class ManualMode(IntEnum):
    """How far a person, or whoever orders for one, has a hand in a machine that moves (row M38)."""

    AUTOMATIC = 0
    HELD = 1
    STEP = 2


class Grade(IntEnum):
    """Strength of an itinerary's reservations."""

    RELEASED = 0
    TENTATIVE = 1
    FIRM = 2


class LegAction(IntEnum):
    """What a machine does during one leg of an itinerary."""

    STAND = 0
    TRAVEL = 1
    WORK = 2
    RIDE = 3


class Side(IntEnum):
    """Side of an alley, seen with the index growing to the right: the street or front side, and the far side."""

    NEAR = 0
    FAR = 1


class TaskPhase(IntEnum):
    """Life of a task, as its present owner announces it."""

    OPEN = 0
    AWARDED = 1
    STARTED = 2
    LOADED = 3
    DONE = 4
    REFUSED = 5
    FORFEITED = 6


class OperatorAction(IntEnum):
    """What an operator does by hand at a compartment (row P52), the same path as a customer's press."""

    PRESS_KEY = 0
    INSERT_TICKET = 1
    CANCEL = 2
    URGENT_TICKET = 3
    CHARGING_KEY = 4


class MachineState(IntEnum):
    """State of a machine, as its heartbeat announces it."""

    STARTING = 0
    IDLE = 1
    WORKING = 2
    WAITING = 3
    OBSTACLE = 4
    STOPPED = 5


class RegenerationPhase(IntEnum):
    """How far the regeneration of a lost machine's tokens is (docs/protocol.md)."""

    NONE = 0
    FREEZE = 1
    READ_BACK = 2
    COMMIT = 3
    ABORT = 4
    REFUSED = 5


class ShuttleAction(IntEnum):
    """Orders to the telescopic shuttle."""

    RETRACT = 0
    REACH = 1
    GRIP = 2
    RELEASE = 3


class DoorName(IntEnum):
    """The two doors of a compartment: towards the street and towards the alley."""

    INPUT = 0
    OUTPUT = 1


class DoorAction(IntEnum):
    """Orders to a door; a door that is not ordered otherwise stays as it is."""

    OPEN = 0
    CLOSE = 1


class LightColour(IntEnum):
    """The traffic light before a compartment's input door."""

    GREEN = 0
    RED = 1


class DeskText(IntEnum):
    """Texts of the display at a desk, one at a time."""

    WELCOME = 0
    TAKE_TICKET = 1
    PLEASE_WAIT = 2
    CAR_READY = 3
    FULL = 4
    CAR_TOO_LARGE = 5
    UNKNOWN_TICKET = 6
    LEAVE_COMPARTMENT = 7
    OUT_OF_ORDER = 8
    NO_CHARGING = 9
    TOO_MANY_TRIES = 10
    INSERT_AGAIN = 11
    GO_TO = 12


class DriveMode(IntEnum):
    """State of an axis drive."""

    STANDING = 0
    MOVING = 1
    BRAKING = 2
    FAULT = 3
    TURNING = 4


class ShuttleMode(IntEnum):
    """Where the shuttle is and what it does."""

    HOME = 0
    MOVING = 1
    REACHED = 2
    GRIPPING = 3
    RELEASING = 4
    FAULT = 5


class DoorPosition(IntEnum):
    """Position of a door as its sensors see it; LOCKED is closed and bolted."""

    OPEN = 0
    OPENING = 1
    CLOSING = 2
    CLOSED = 3
    LOCKED = 4
    FORCED = 5


class DeskInput(IntEnum):
    """What a customer does at the desk."""

    KEY = 0
    TICKET = 1
    CANCEL = 2
    CHARGING_KEY = 3


class OrderResult(IntEnum):
    """What became of an order, as a desk tells its counter."""

    RECEIVED = 0
    IN_HAND = 1
    DONE = 2
    REFUSED = 3
