"""A robot's steps: every phase meets whatever its devices may say, and does what its table says and nothing else."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

import pytest

from onboard.contract.cell import ArmMode, ArmPhase, ArmProgress, GripAction, GripMode, PartAt
from onboard.contract.cell_device import ArmOrder, ArmState, GripOrder, GripState
from onboard.contract.codes import ManualMode, TokenKind
from onboard.contract.messages import ManualOrder, Reference, TaskReport
from onboard.core.effects import Actuate, Effect, Record, Send
from onboard.core.motion_authority import acts
from onboard.core.records import TokenHeldRecord
from onboard.holon.holon import Holon
from onboard.systems.cell.contracts import part_token
from onboard.systems.cell.geometry import Point
from onboard.systems.cell.records import ContractRecord, ContractStage, StageRecord
from onboard.systems.cell.robot import ArmRobot
from onboard.systems.cell.steps import CHOOSING, TABLE, ArmDeed, ArmFinding
from onboard.systems.registry import factory_for
from tests.cell.playing import cell

ARM = 1
TASK, PART, OTHER = Reference(9, 1), Reference(9, 7), Reference(9, 8)
PLACES = {"start": Point(10_000, 10_000), "end": Point(20_000, 10_000), "home": Point(8_000, 11_000)}
CONTRACT = ContractRecord(
    TASK, PART, ARM, 0, "10000,10000", "20000,10000", "10000,10000 20000,10000", "", (ARM,), 1.0, 1.0, (ARM,), 0
)
NOW_US, LATER_US = 10_000_000, 20_000_000
WORKING = (ArmPhase.TO_PART, ArmPhase.TAKING, ArmPhase.CARRYING, ArmPhase.PUTTING)


@dataclass(frozen=True)
class Words:
    """Where the drive says that it stands, what the gripper says, and whether it has had an order in this life."""

    place: str
    grip: GripMode
    part: Reference
    is_ordered: bool


GRIPS = [(mode, PART if mode is GripMode.HOLDING else Reference(0, 0)) for mode in GripMode]
WORDS = [
    Words(place, *grip, ordered)
    for place, grip, ordered in product(PLACES, [*GRIPS, (GripMode.HOLDING, OTHER)], (True, False))
]


def robot(words: Words, stage: ContractStage | None, *, is_custodian: bool) -> ArmRobot:
    """One with a contract at ``stage``, or with none."""
    site = cell()
    machine = site.machines[ARM]
    key = part_token(PART)
    entries = [CONTRACT.entry, StageRecord(TASK, stage, 0).entry] if stage is not None else []
    if is_custodian:
        entries.append(TokenHeldRecord(TokenKind.CAR, key.number, 1, ARM).entry)
    behaviour = Holon(site, machine, factory_for(site, machine.kind), boot=2, entries=entries).behaviour
    assert isinstance(behaviour, ArmRobot)
    behaviour.fleet.tokens.trust()
    behaviour.fleet.motion.why_still = acts
    if words.is_ordered:
        behaviour.gripper.order(GripAction.TAKE, PART, NOW_US)
    return behaviour


def say(behaviour: ArmRobot, words: Words) -> None:
    behaviour.sense(ArmState(ARM, 0, *PLACES[words.place], ArmMode.RESTING), NOW_US)
    behaviour.sense(GripState(ARM, behaviour.gripper.link.sequence, words.grip, words.part), NOW_US)


def hold(behaviour: ArmRobot, *, is_held: bool) -> None:
    if is_held:
        behaviour.hear(ManualOrder(251, ARM, 1, ManualMode.HELD), NOW_US)


def meant(phase: ArmPhase, words: Words, *, is_held: bool) -> ArmFinding:
    """What the words come to for a part in hand, told once more; in a person's hand nothing is begun."""
    found = unheld(phase, words)
    begins = found in (ArmFinding.ELSEWHERE, ArmFinding.THERE)
    is_at_work = words.grip is GripMode.BUSY or (words.is_ordered and words.grip is not GripMode.NOTHING_THERE)
    return ArmFinding.HELD if is_held and begins and not is_at_work else found


def unheld(phase: ArmPhase, words: Words) -> ArmFinding:
    match phase:
        case ArmPhase.TO_PART:
            return ArmFinding.THERE if words.place == "start" else ArmFinding.ELSEWHERE
        case ArmPhase.CARRYING:
            return ArmFinding.THERE if words.place == "end" else ArmFinding.ELSEWHERE
        case ArmPhase.PUTTING:
            return ArmFinding.GRIPPED if words.grip is GripMode.OPEN else ArmFinding.THERE
    if words.grip is GripMode.BUSY:
        return ArmFinding.GRIPPING
    if (words.grip, words.part) == (GripMode.HOLDING, PART):
        return ArmFinding.GRIPPED
    if words.grip is GripMode.OPEN and words.place == "end" and not words.is_ordered:
        return ArmFinding.LIES
    return ArmFinding.THERE if words.place == "start" else ArmFinding.ELSEWHERE


#: What is ordered, written and told; a new phase is told besides.
SAID: dict[ArmDeed, list[object]] = {
    ArmDeed.WAIT: [],
    ArmDeed.CHOOSE: [],
    ArmDeed.TO_START: [PLACES["start"]],
    ArmDeed.TO_END: [PLACES["end"]],
    ArmDeed.BEGIN: [ContractStage.TAKEN],
    ArmDeed.TAKE: [GripAction.TAKE],
    ArmDeed.LIFTED: ["aboard"],
    ArmDeed.REST: [],
    ArmDeed.LEAVE: [],
    ArmDeed.PUT: [GripAction.PUT],
    ArmDeed.PUT_DOWN: [ContractStage.PUT, "lies", ContractStage.OVER, "DONE"],
}


def told(effects: list[Effect]) -> Iterator[object]:
    for one in effects:
        match one:
            case Actuate(ArmOrder() as order):
                yield Point(order.x_mm, order.y_mm)
            case Actuate(GripOrder() as order):
                yield order.grip_action
            case Record(StageRecord() as record):
                yield record.stage
            case Send(PartAt() as at):
                yield "aboard" if at.aboard else "lies"
            case Send(TaskReport() as report):
                yield report.phase.name
            case Send(ArmProgress() as progress):
                yield progress.arm_phase


def line(phase: ArmPhase, finding: ArmFinding) -> tuple[ArmPhase, list[object]]:
    following, deed = TABLE[phase, finding]
    return following, SAID[deed] + ([following] if following is not phase else [])


@pytest.mark.parametrize("phase", WORKING)
@pytest.mark.parametrize("is_held", [False, True])
def test_every_phase_meets_every_word_of_drive_and_gripper(phase: ArmPhase, is_held: bool) -> None:
    stage = ContractStage.WON if phase is ArmPhase.TO_PART else ContractStage.TAKEN
    for words in WORDS:
        one = robot(words, stage, is_custodian=True)
        one.phase, one.active = phase, TASK
        say(one, words)
        hold(one, is_held=is_held)
        finding = meant(phase, words, is_held=is_held)
        following, said = line(phase, finding)
        assert (list(told(one.advance(LATER_US))), one.phase) == (said, following), words
        assert (one.active is None) is ("lies" in said or TABLE[phase, finding][1] is ArmDeed.LEAVE)


@pytest.mark.parametrize("phase", CHOOSING)
@pytest.mark.parametrize("stage", [None, ContractStage.WON, ContractStage.TAKEN])
@pytest.mark.parametrize("is_custodian", [True, False])
@pytest.mark.parametrize("is_held", [False, True])
def test_without_a_part_in_hand_the_next_is_chosen(
    phase: ArmPhase, stage: ContractStage | None, is_custodian: bool, is_held: bool
) -> None:
    for words in [one for one in WORDS if not one.is_ordered]:
        one = robot(words, stage, is_custodian=is_custodian)
        one.phase = phase
        say(one, words)
        hold(one, is_held=is_held)
        finding = choice(stage, is_custodian=is_custodian and not is_held)
        following, said = line(phase, finding)
        if TABLE[phase, finding][1] is ArmDeed.CHOOSE:
            # What was chosen is begun at once.
            following, then = line(following, meant(following, words, is_held=False))
            said += then
        assert (list(told(one.advance(LATER_US))), one.phase) == (said, following), words


def choice(stage: ContractStage | None, *, is_custodian: bool) -> ArmFinding:
    if stage is None:
        return ArmFinding.NOTHING
    if not is_custodian:
        return ArmFinding.NO_RIGHT
    return ArmFinding.HALF_TAKEN if stage is ContractStage.TAKEN else ArmFinding.MAY_TAKE


def test_a_line_of_the_table_is_for_what_can_be() -> None:
    every = product(WORKING, WORDS, (False, True))
    met = {(phase, meant(phase, words, is_held=is_held)) for phase, words, is_held in every}
    stands = product((None, ContractStage.WON, ContractStage.TAKEN), (True, False))
    chosen = {choice(stage, is_custodian=custodian) for stage, custodian in stands}
    assert met | set(product(CHOOSING, chosen)) == set(TABLE)
