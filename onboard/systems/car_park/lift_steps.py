"""What a lift does next: one table of (phase, finding), for a ride from the grant of the platform until it is back."""

from enum import Enum


class LiftPhase(Enum):
    """What the lift is doing for its present ride."""

    STARTING = "starting"
    FREE = "free"
    BOARDING = "boarding"
    RIDING = "riding"
    LEAVING = "leaving"


class LiftFinding(Enum):
    """What the sensors, the rights to gate and platform, the journal and the robots' plans come to, for the phase."""

    NOTHING = "nothing that changes the phase"
    CLEAR = "the platform is its own and empty"
    RIDE_BEGUN = "the journal has a ride that was begun, and its end is elsewhere"
    RIDE_AT_END = "the journal has a ride that was begun, and the lift stands at its end"
    RIDE_PLANNED = "who has the platform plans a ride from here"
    WANTED = "a ride is planned"
    GRANTED = "the robot of the next ride asks for the platform, and the lift stands at its floor"
    ABOARD = "the carrier is wholly aboard, and the gate has been out and is back"
    GIVEN_UP = "the platform is back, and nobody has boarded"
    ON_THE_WAY = "the lift does not stand at the ride's end"
    THERE = "it stands there"
    OUT = "platform and gate are back"
    ONWARD = "who is aboard says that it rides on from here"


class LiftDeed(Enum):
    """What the lift does about it, once in each round."""

    STAND = "order the drive no more"
    WAIT = "nothing: the drive has no order yet"
    STATE = "state where it is, and its tokens"
    TO_BOARD = "drive to where the next ride begins"
    LET_IN = "the ride is in hand, and the robot gets the platform"
    SET_OFF = "journal the ride, and drive to its end"
    TO_END = "drive on to the ride's end"
    ARRIVE = "order the drive no more: the gate may go out again"
    END = "journal that the ride is over, and look for the next at once"


#: (phase, finding) -> (phase that follows, deed).
LIFT_TABLE: dict[tuple[LiftPhase, LiftFinding], tuple[LiftPhase, LiftDeed]] = {
    (LiftPhase.STARTING, LiftFinding.NOTHING): (LiftPhase.STARTING, LiftDeed.WAIT),
    (LiftPhase.STARTING, LiftFinding.CLEAR): (LiftPhase.FREE, LiftDeed.STATE),
    (LiftPhase.STARTING, LiftFinding.RIDE_PLANNED): (LiftPhase.BOARDING, LiftDeed.STATE),
    (LiftPhase.STARTING, LiftFinding.RIDE_BEGUN): (LiftPhase.RIDING, LiftDeed.STATE),
    (LiftPhase.STARTING, LiftFinding.RIDE_AT_END): (LiftPhase.LEAVING, LiftDeed.STATE),
    (LiftPhase.FREE, LiftFinding.NOTHING): (LiftPhase.FREE, LiftDeed.STAND),
    (LiftPhase.FREE, LiftFinding.WANTED): (LiftPhase.FREE, LiftDeed.TO_BOARD),
    (LiftPhase.FREE, LiftFinding.GRANTED): (LiftPhase.BOARDING, LiftDeed.LET_IN),
    (LiftPhase.BOARDING, LiftFinding.NOTHING): (LiftPhase.BOARDING, LiftDeed.STAND),
    (LiftPhase.BOARDING, LiftFinding.ABOARD): (LiftPhase.RIDING, LiftDeed.SET_OFF),
    # Its plan has changed.
    (LiftPhase.BOARDING, LiftFinding.GIVEN_UP): (LiftPhase.FREE, LiftDeed.END),
    (LiftPhase.RIDING, LiftFinding.ON_THE_WAY): (LiftPhase.RIDING, LiftDeed.TO_END),
    (LiftPhase.RIDING, LiftFinding.THERE): (LiftPhase.LEAVING, LiftDeed.ARRIVE),
    (LiftPhase.LEAVING, LiftFinding.NOTHING): (LiftPhase.LEAVING, LiftDeed.STAND),
    (LiftPhase.LEAVING, LiftFinding.OUT): (LiftPhase.FREE, LiftDeed.END),
    # It has not given the platform back: it has come back before it could, or has turned.
    (LiftPhase.LEAVING, LiftFinding.ONWARD): (LiftPhase.RIDING, LiftDeed.SET_OFF),
}
