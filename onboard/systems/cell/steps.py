"""What a robot of the cell does next: one table of (phase, finding), the same for a start in the middle of a grip."""

from enum import Enum

from onboard.contract.cell import ArmPhase


class ArmFinding(Enum):
    """What contracts, tokens and the last words of drive and gripper come to, for the phase in which the robot is."""

    NOTHING = "no part is in hand, and no contract either"
    NO_RIGHT = "no part is in hand, and none of the contracts' parts may be taken, or a person holds the robot"
    MAY_TAKE = "no part is in hand, and a contract's may be taken"
    HALF_TAKEN = "no part is in hand, and the journal says that one was being taken"
    ELSEWHERE = "the robot does not stand where this phase needs it"
    THERE = "it stands where this phase needs it, and the gripper is not done"
    GRIPPING = "the gripper is at work"
    GRIPPED = "the gripper has done what this phase is for"
    HELD = "a person holds the robot, and the gripper is not at work"
    LIES = "the gripper is open where the part is to lie, and has no order: it was put down before a restart"


class ArmDeed(Enum):
    """What the robot does about what it found, once in each round: the table of steps chooses it."""

    WAIT = "nothing"
    CHOOSE = "take the most urgent contract in hand"
    TO_START = "drive on to where the part lies"
    TO_END = "drive on to where the part is to lie"
    BEGIN = "journal that the part is being taken"
    TAKE = "order the gripper to take"
    LIFTED = "tell that the part is aboard"
    REST = "order the drive no more"
    LEAVE = "order the drive no more, and choose anew what to take"
    PUT = "order the gripper to put down"
    PUT_DOWN = "journal and tell that the part lies where it is to lie"


#: A part was put down in TAKING or PUTTING; in any of these none is in hand at times.
CHOOSING = (ArmPhase.IDLE, ArmPhase.WAITING, ArmPhase.TAKING, ArmPhase.PUTTING)

#: A part is in hand: being taken, aboard, or being put down.
WITH_A_PART = (ArmPhase.TAKING, ArmPhase.CARRYING, ArmPhase.PUTTING)

#: (phase, finding) -> (phase that follows, deed).
TABLE: dict[tuple[ArmPhase, ArmFinding], tuple[ArmPhase, ArmDeed]] = {
    **{(phase, ArmFinding.NOTHING): (ArmPhase.IDLE, ArmDeed.WAIT) for phase in CHOOSING},
    **{(phase, ArmFinding.NO_RIGHT): (ArmPhase.WAITING, ArmDeed.WAIT) for phase in CHOOSING},
    **{(phase, ArmFinding.MAY_TAKE): (ArmPhase.TO_PART, ArmDeed.CHOOSE) for phase in CHOOSING},
    **{(phase, ArmFinding.HALF_TAKEN): (ArmPhase.TAKING, ArmDeed.CHOOSE) for phase in CHOOSING},
    (ArmPhase.TO_PART, ArmFinding.ELSEWHERE): (ArmPhase.TO_PART, ArmDeed.TO_START),
    # What is journalled first tells whoever starts again to look into the gripper.
    (ArmPhase.TO_PART, ArmFinding.THERE): (ArmPhase.TAKING, ArmDeed.BEGIN),
    (ArmPhase.TAKING, ArmFinding.ELSEWHERE): (ArmPhase.TAKING, ArmDeed.TO_START),
    (ArmPhase.TAKING, ArmFinding.THERE): (ArmPhase.TAKING, ArmDeed.TAKE),
    (ArmPhase.TAKING, ArmFinding.GRIPPING): (ArmPhase.TAKING, ArmDeed.WAIT),
    (ArmPhase.TAKING, ArmFinding.GRIPPED): (ArmPhase.CARRYING, ArmDeed.LIFTED),
    (ArmPhase.TAKING, ArmFinding.LIES): (ArmPhase.TAKING, ArmDeed.PUT_DOWN),
    (ArmPhase.CARRYING, ArmFinding.ELSEWHERE): (ArmPhase.CARRYING, ArmDeed.TO_END),
    (ArmPhase.CARRYING, ArmFinding.THERE): (ArmPhase.PUTTING, ArmDeed.REST),
    # In a person's hand a part that is aboard stays there.
    (ArmPhase.TO_PART, ArmFinding.HELD): (ArmPhase.WAITING, ArmDeed.LEAVE),
    **{(phase, ArmFinding.HELD): (phase, ArmDeed.REST) for phase in WITH_A_PART},
    (ArmPhase.PUTTING, ArmFinding.THERE): (ArmPhase.PUTTING, ArmDeed.PUT),
    (ArmPhase.PUTTING, ArmFinding.GRIPPED): (ArmPhase.PUTTING, ArmDeed.PUT_DOWN),
}
