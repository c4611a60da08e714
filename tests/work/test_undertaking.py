"""What a machine has undertaken: every standing meets every event, on each kind of machine that has tasks in hand."""

from dataclasses import dataclass
from itertools import product

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import CallResult, Criterion, KindCode, Operation, Reason, TaskPhase
from onboard.contract.messages import Award, CallForProposals, Reference, TaskReport
from onboard.core.effects import Effect, Record, Send
from onboard.core.journal_records import JournalRecord
from onboard.holon.holon import Holon
from onboard.systems.cell.records import ContractRecord, ContractStage, StageRecord
from onboard.systems.cell.robot import ArmRobot
from onboard.systems.graph.records import ErrandRecord
from onboard.systems.graph.robot import GraphRobot
from onboard.systems.registry import factory_for
from onboard.systems.turning.machine import LatheMachine
from onboard.systems.turning.records import BatchStage, JobOverRecord, JobRecord, JobStageRecord
from onboard.work.undertaking import TABLE, TaskEvent, TaskStanding, UndertakingAnswer

#: The desk of all three sites.
DESK = 9
TASK = Reference(DESK, 1)
NOW_US = 30_000_000


@dataclass(frozen=True)
class Subject:
    """A machine, and what its journal has of one task in each standing."""

    site: str
    node: int
    other: int
    won: JournalRecord
    begun: JournalRecord
    over: JournalRecord


CONTRACT = ContractRecord(
    TASK, TASK, 1, 0, "5000,6000", "9000,9000", "5000,6000 9000,9000", "5000,6000", (), 1.0, 1.0, (1,), 0
)
SUBJECTS = {
    "arm": Subject(
        "cell",
        1,
        2,
        CONTRACT,
        StageRecord(TASK, ContractStage.TAKEN, 0),
        StageRecord(TASK, ContractStage.OVER, 0),
    ),
    "lathe": Subject(
        "turning",
        3,
        1,
        JobRecord(TASK, 1, 1, 16, 5, 1000),
        JobStageRecord(TASK, BatchStage.MAKING),
        JobOverRecord(TASK),
    ),
    "robot of a graph": Subject(
        "graph", 11, 12, ErrandRecord(TASK, (4, 6)), ErrandRecord(TASK, (6,)), ErrandRecord(TASK, ())
    ),
}
WRITTEN = {
    TaskStanding.UNKNOWN: (),
    TaskStanding.WON: ("won",),
    TaskStanding.BEGUN: ("won", "begun"),
    TaskStanding.OVER: ("won", "over"),
}


def machine_of(subject: Subject, *records: JournalRecord) -> ArmRobot | LatheMachine | GraphRobot:
    """The machine as it goes on with these records."""
    site = find_site(subject.site)
    machine = site.machines[subject.node]
    entries = [one.entry for one in records]
    behaviour = Holon(site, machine, factory_for(site, machine.kind), boot=2, entries=entries).behaviour
    assert isinstance(behaviour, ArmRobot | LatheMachine | GraphRobot)
    return behaviour


def award(winner: int, result: CallResult) -> Award:
    """Of a call of which the machine knows nothing."""
    return Award(DESK, 77, winner, TASK, 1, result, Reason.NONE)


def happens(machine: ArmRobot | LatheMachine | GraphRobot, subject: Subject, event: TaskEvent) -> list[Effect]:
    """An event, as a word on the bus where it is one."""
    match event:
        case TaskEvent.AWARDED_AGAIN:
            return machine.hear(award(subject.node, CallResult.AWARDED), NOW_US)
        case TaskEvent.TO_ANOTHER:
            return machine.hear(award(subject.other, CallResult.AWARDED), NOW_US)
        case TaskEvent.CALLED:
            call = CallForProposals(
                DESK, 78, TASK, Operation.TRANSPORT, KindCode.ARM, Criterion.MONEY, 1, 0, 60_000, 0, 0, TASK, 0
            )
            return machine.hear(call, NOW_US)
        case _:
            tasks, work = machine.tasks, next(iter(machine_of(subject, subject.won).tasks.in_hand.values()))
            answer = tasks.meet(TASK, event, work)  # type: ignore[arg-type]  # the work of the same kind of machine
            return [tasks.report(TASK)] if answer is UndertakingAnswer.REPORT else []


@pytest.mark.parametrize("name", SUBJECTS)
@pytest.mark.parametrize(("standing", "event"), list(product(TaskStanding, TaskEvent)))
def test_every_standing_meets_every_event(name: str, standing: TaskStanding, event: TaskEvent) -> None:
    subject = SUBJECTS[name]
    machine = machine_of(subject, *(getattr(subject, one) for one in WRITTEN[standing]))
    assert machine.tasks.standing(TASK) is standing
    effects = happens(machine, subject, event)
    following, answer = TABLE.get((standing, event), (standing, UndertakingAnswer.NOTHING))
    assert machine.tasks.standing(TASK) is following
    said = [
        (one.message.phase, one.message.reason)
        for one in effects
        if isinstance(one, Send) and isinstance(one.message, TaskReport)
    ]
    phase = TaskPhase.DONE if following is TaskStanding.OVER else TaskPhase.AWARDED
    assert (
        said
        == {
            UndertakingAnswer.NOTHING: [],
            UndertakingAnswer.REPORT: [(phase, Reason.NONE)],
            UndertakingAnswer.GIVES_BACK: [(TaskPhase.FORFEITED, Reason.JOURNAL_LOST)],
        }[answer]
    )
    if event is TaskEvent.TO_ANOTHER and standing is TaskStanding.WON:
        # The journal knows it, too.
        lost = [one.what for one in effects if isinstance(one, Record)]
        assert machine_of(subject, subject.won, *lost).tasks.standing(TASK) is TaskStanding.UNKNOWN


@pytest.mark.parametrize("name", SUBJECTS)
def test_who_is_not_its_giver_takes_nothing_away(name: str) -> None:
    subject = SUBJECTS[name]
    machine = machine_of(subject, subject.won)
    machine.hear(Award(subject.other, 77, subject.other, TASK, 1, CallResult.AWARDED, Reason.NONE), NOW_US)
    assert machine.tasks.standing(TASK) is TaskStanding.WON
