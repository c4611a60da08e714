"""Plans: a route as elementary actions (rows M09, M10), and how they are told on the bus and read again.

Times are bus time in us, or seconds where a test says so: nothing here depends on the unit but ``to_frames``.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.contract.messages import Message, Reference
from onboard.contract.terminal import Action, PlanHead, PlanStep, PlanTask
from onboard.core.serial import BUS_MS_MODULUS, from_bus_ms, to_bus_ms
from onboard.systems.terminal.site import EntityKind, Terminal

#: Most steps of a plan: their numbers have five bits, and 31 means none.
MAX_STEPS = 31
NO_STEP = 31
#: Farthest that a step ends after its plan's begin, us: 24 bits of ms (PlanStep, dbc/terminal.dbc), 4.6 h.
FARTHEST_US = (2**24 - 1) * 1000


class EntityStay(NamedTuple):
    """A machine's stay in an entity, named by its first step there."""

    owner: int
    step: int


#: After nobody that is not there yet.
NOBODY_BEFORE = EntityStay(0, 0)


class ActionStep(NamedTuple):
    """One elementary action on ``entity``: at least ``duration`` long; told to end at ``end``; whom it comes after."""

    action: Action
    entity: int
    duration: int
    end: int = 0
    after: EntityStay = NOBODY_BEFORE


class Load(NamedTuple):
    """One box of a plan and the steps that pick it up and put it down; ``NO_STEP`` for one aboard already.

    ``before`` is the date of the putting down, 0 for none: told by the desk, not by the plan.
    """

    box: int
    task: Reference
    pick: int
    put: int
    before: int = 0


@dataclass(frozen=True, slots=True)
class ActionPlan:
    """A machine's elementary actions in order, from ``begin`` on."""

    owner: int
    version: int
    begin: int
    steps: tuple[ActionStep, ...]
    loads: tuple[Load, ...] = ()

    @property
    def end(self) -> int:
        """When its last step was planned to end."""
        return self.steps[-1].end if self.steps else self.begin

    def visits(self) -> list[tuple[int, int]]:
        """First and last step of each stay in one entity, in order."""
        found: list[tuple[int, int]] = []
        for number, step in enumerate(self.steps):
            if found and self.steps[number - 1].entity == step.entity:
                found[-1] = (found[-1][0], number)
            else:
                found.append((number, number))
        return found


def drive_steps(site: Terminal, route: tuple[int, ...], before: int = 0) -> list[ActionStep]:
    """GOTO for each entity of a route but the last, which is what they lead to."""
    steps = []
    for number, entity in enumerate(route[:-1]):
        came = route[number - 1] if number else before
        steps.append(ActionStep(Action.GOTO, entity, site.entities[entity].crossing_us(came, route[number + 1])))
    return steps


def handling_steps(site: Terminal, station: int, action: Action) -> list[ActionStep]:
    """DOCK, PICK UP or PUT DOWN, UNDOCK."""
    return [
        ActionStep(Action.DOCK, station, site.dock_us),
        ActionStep(action, station, site.handle_us),
        ActionStep(Action.UNDOCK, station, site.undock_us),
    ]


def to_frames(plan: ActionPlan) -> list[Message]:
    """A plan as it is told.

    Where bus time was set by hours meanwhile, steps that are over have the times of before: they are told as over at
    its begin or its end, and the begin so near that all can be told.
    """
    ends = [step.end for step in plan.steps]
    begin = min(plan.begin, *ends) if ends else plan.begin
    begin = max(begin, plan.end - FARTHEST_US)
    frames: list[Message] = [PlanHead(plan.owner, plan.version, len(plan.steps), len(plan.loads), to_bus_ms(begin))]
    for number, load in enumerate(plan.loads):
        frames.append(PlanTask(plan.owner, plan.version, number, load.pick, load.put, load.box, load.task))
    for number, step in enumerate(plan.steps):
        end = min(max(step.end, begin), plan.end)
        end_ms = (to_bus_ms(end) - to_bus_ms(begin)) % BUS_MS_MODULUS
        frames.append(PlanStep(plan.owner, plan.version, number, step.action, step.entity, end_ms, *step.after))
    return frames


@dataclass
class PlanReader:
    """Puts the frames of one machine's plans together; frames of a plan that is incomplete are inert."""

    site: Terminal
    head: PlanHead | None = None
    steps: dict[int, PlanStep] = field(default_factory=dict)
    tasks: dict[int, PlanTask] = field(default_factory=dict)

    def feed(self, message: PlanHead | PlanStep | PlanTask, now_us: int) -> ActionPlan | None:
        """The plan that this frame completes, or None. Entities that the site does not have make it none."""
        match message:
            case PlanHead():
                if self.head != message:
                    self.head, self.steps, self.tasks = message, {}, {}
            case PlanStep() if self.head is not None and message.version == self.head.version:
                self.steps[message.step] = message
            case PlanTask() if self.head is not None and message.version == self.head.version:
                self.tasks[message.part] = message
        head = self.head
        if head is None or len(self.steps) < head.steps or len(self.tasks) < head.tasks:
            return None
        self.head = None
        return self._plan(head, now_us)

    def _plan(self, head: PlanHead, now_us: int) -> ActionPlan | None:
        told = [self.steps[number] for number in sorted(self.steps)][: head.steps]
        if any(step.entity not in self.site.entities for step in told):
            return None
        begin_us = from_bus_ms(head.begin_ms, now_us)
        ways = [step.entity for step in told]
        steps = []
        for number, step in enumerate(told):
            before, after = ways[number - 1] if number else 0, ways[number + 1] if number + 1 < len(ways) else 0
            duration = _duration(self.site, step.action, step.entity, before, after)
            end_us = begin_us + step.end_ms * 1000
            steps.append(
                ActionStep(step.action, step.entity, duration, end_us, EntityStay(step.after, step.after_step))
            )
        tasks = [self.tasks[number] for number in sorted(self.tasks)][: head.tasks]
        loads = tuple(Load(task.box, task.task, task.pick, task.put) for task in tasks)
        return ActionPlan(head.sender, head.version, begin_us, tuple(steps), loads)


def _duration(site: Terminal, action: Action, entity: int, before: int, after: int) -> int:
    match action:
        case Action.GOTO:
            return site.entities[entity].crossing_us(before, after)
        case Action.DOCK:
            return site.dock_us
        case Action.UNDOCK:
            return site.undock_us
        case _:
            return site.handle_us


def is_area(site: Terminal, entity: int) -> bool:
    """Whether robots may stand there as long as they like: every one has a bay of its own."""
    return site.entities[entity].kind is EntityKind.AREA
