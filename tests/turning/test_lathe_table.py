"""A lathe's steps: every stage meets whatever the control may say, and orders what its table says and nothing else."""

from itertools import product

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import CallResult, Reason
from onboard.contract.messages import Award, Reference, TaskReport
from onboard.contract.turning import LatheAction, NcMode
from onboard.contract.turning_device import LatheOrder, NcState
from onboard.core.effects import Actuate, Effect, Record, Send, Tell
from onboard.core.journal_records import JournalRecord
from onboard.core.motion_authority import ALONE, acts, authorised
from onboard.holon.holon import Holon
from onboard.systems.registry import factory_for
from onboard.systems.turning.machine import TABLE, Control, Deed, LatheMachine
from onboard.systems.turning.records import BatchStage, JobRecord, JobStageRecord

LATHE, BATCH = 3, 5
TASK = Reference(9, 4)
JOB = JobRecord(TASK, 1, 1, 16, BATCH, 1000)
NOW_US, LATER_US = 10_000_000, 20_000_000
#: What the control says; the number of the order that it obeyed last is that of the machine's last.
MODES = {"ready": NcMode.READY, "works": NcMode.RUNNING, "held": NcMode.HELD}
PROGRAMS = {"its program": (9 * 31 + 4) % 255 + 1, "another program": 7}
PARTS = {"none made": 0, "all made": BATCH}


def machine_in(stage: BatchStage) -> LatheMachine:
    site = find_site("turning")
    machine = site.machines[LATHE]
    entries = [JOB.entry]
    behaviour = Holon(site, machine, factory_for(site, machine.kind), boot=2, entries=entries).behaviour
    assert isinstance(behaviour, LatheMachine)
    behaviour.tasks.in_hand[TASK].stage = stage
    behaviour.fleet.motion.why_still = acts
    return behaviour


def expected(stage: BatchStage, mode: str, program: str, parts: str, *, obeyed: bool) -> Control:
    """What the words of the control mean, told once more."""
    if mode != "ready":
        return Control.BUSY
    if not obeyed:
        return Control.UNMOVED
    if stage is BatchStage.WON:
        return Control.FREE if program == "its program" else Control.OTHER_PROGRAM
    return Control.ALL_MADE if stage is BatchStage.MAKING and parts == "all made" else Control.FREE


def kind_of(effects: list[Effect]) -> list[object]:
    """What is ordered, written and told of the task."""
    found: list[object] = []
    for one in effects:
        match one:
            case Actuate(LatheOrder() as order):
                found.append(order.lathe_action)
            case Tell():
                found += ["program"] if "program" not in found else []
            case Record(what):
                found.append(type(what).__name__)
            case Send(TaskReport() as report):
                found.append(report.phase.name)
    return found


SAID: dict[Deed, list[object]] = {
    Deed.GO_ON: [LatheAction.SET_UP],
    Deed.SAY_AGAIN: [LatheAction.MAKE],
    Deed.LOAD: ["program"],
    Deed.SET_UP: ["JobStageRecord", LatheAction.SET_UP],
    Deed.BEGIN: ["JobStageRecord", LatheAction.MAKE],
    Deed.MAKE: [LatheAction.MAKE],
    Deed.FINISH: ["JobOverRecord", "DONE"],
}


@pytest.mark.parametrize("stage", BatchStage)
@pytest.mark.parametrize(("mode", "program", "parts", "obeyed"), list(product(MODES, PROGRAMS, PARTS, (True, False))))
def test_every_stage_meets_every_word_of_the_control(
    stage: BatchStage, mode: str, program: str, parts: str, obeyed: bool
) -> None:
    machine = machine_in(stage)
    machine.sense(NcState(LATHE, 40, NcMode.READY, PROGRAMS[program], 0), 0)
    if not obeyed:
        machine.link.order((LatheAction.MAKE, 0, 0), authorised(machine.fleet.motion, ALONE), NOW_US)
    machine.sense(NcState(LATHE, 40, MODES[mode], PROGRAMS[program], PARTS[parts]), NOW_US)
    following, deed = TABLE[stage, expected(stage, mode, program, parts, obeyed=obeyed)]
    effects = machine.advance(LATER_US)
    said = [LatheAction.MAKE] if (stage, deed) == (BatchStage.MAKING, Deed.GO_ON) else SAID[deed]
    assert kind_of(effects) == said
    orders = [one.message for one in effects if isinstance(one, Actuate)]
    if deed is Deed.GO_ON:
        assert [one.sequence for one in orders if isinstance(one, LatheOrder)] == [40], "nothing is begun by it"
    standing = machine.tasks.in_hand.get(TASK)
    assert (standing.stage if standing is not None else None) is (None if deed is Deed.FINISH else following)


def test_a_line_of_the_table_is_for_what_can_be() -> None:
    met = {
        (stage, expected(stage, mode, program, parts, obeyed=obeyed))
        for stage, mode, program, parts, obeyed in product(BatchStage, MODES, PROGRAMS, PARTS, (True, False))
    }
    assert met == set(TABLE)


def test_a_lathe_that_is_set_up_goes_on_after_a_restart_and_one_that_was_not_begins_anew() -> None:
    def stage_after(*records: JournalRecord) -> BatchStage:
        site = find_site("turning")
        machine = site.machines[LATHE]
        entries = [JOB.entry, *(one.entry for one in records)]
        behaviour = Holon(site, machine, factory_for(site, machine.kind), boot=2, entries=entries).behaviour
        assert isinstance(behaviour, LatheMachine)
        return behaviour.tasks.in_hand[TASK].stage

    assert stage_after(JobStageRecord(TASK, BatchStage.SETTING)) is BatchStage.WON, "whether it was obeyed is not known"
    assert stage_after(JobStageRecord(TASK, BatchStage.MAKING)) is BatchStage.MAKING


def test_who_has_nothing_in_hand_any_more_is_not_woken_for_what_its_control_is_at() -> None:
    """Its desk gave the order to another while it was off, and its control was still at it: a wake without end."""
    machine = machine_in(BatchStage.WON)
    machine.sense(NcState(LATHE, 40, NcMode.SETTING, PROGRAMS["its program"], 0), NOW_US)
    machine.advance(NOW_US)
    due_us = machine.next_wake()
    assert due_us is not None and due_us > NOW_US, "while it has it, the control hears its order again"
    machine.hear(Award(TASK.origin, 7, 1, TASK, 1, CallResult.AWARDED, Reason.NONE), NOW_US)
    assert not machine.tasks.in_hand
    machine.advance(LATER_US)
    assert machine.next_wake() is None
