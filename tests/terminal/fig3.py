"""The network that Fig. 3 of the paper implies, in whole seconds, and the plan printed there."""

from dataclasses import replace

from onboard.contract.codes import KindCode
from onboard.contract.messages import NO_REFERENCE
from onboard.contract.terminal import Action
from onboard.core.site import Machine, Segment, Timing
from onboard.systems.terminal.dates import StepDate
from onboard.systems.terminal.plan import ActionPlan, EntityStay, Load, drive_steps, handling_steps
from onboard.systems.terminal.site import Box, Entity, EntityKind, StationKind, Terminal
from onboard.systems.terminal.traffic import Traffic

A1, L3, C1, L2, A4, L11, A2, S2, S1 = 1, 2, 3, 4, 5, 6, 7, 8, 9
TIMING = Timing(0, 0, 1, 0, 1, 0, 0, 0, 0, 0)
#: The fifteen elementary actions as printed: entity and [st et].
PRINTED = [
    (Action.GOTO, A1, 10, 40), (Action.GOTO, L3, 40, 50), (Action.GOTO, C1, 50, 55), (Action.GOTO, L2, 55, 67),
    (Action.GOTO, A4, 67, 77), (Action.DOCK, S2, 77, 79), (Action.PICK_UP, S2, 79, 81), (Action.UNDOCK, S2, 81, 83),
    (Action.GOTO, A4, 83, 93), (Action.GOTO, L11, 93, 113), (Action.GOTO, C1, 113, 119), (Action.GOTO, A2, 119, 125),
    (Action.DOCK, S1, 125, 127), (Action.PUT_DOWN, S1, 127, 129), (Action.UNDOCK, S1, 129, 131),
]  # fmt: skip
OUT, BACK = (A1, L3, C1, L2, A4, S2), (A4, L11, C1, A2, S1)


def fig3(lane_capacity: int = 0, vehicles: int = 3) -> Terminal:
    """Durations in seconds; crossings as in the paper, without a limit."""

    def lane(number: int, name: str, seconds: int, leads_to: int) -> Entity:
        return Entity(number, name, EntityKind.LANE, seconds, lane_capacity, (leads_to,))

    def area(number: int, name: str, seconds: int, *leads_to: int) -> Entity:
        return Entity(number, name, EntityKind.AREA, seconds, 0, leads_to)

    def station(number: int, name: str, within: int) -> Entity:
        return Entity(number, name, EntityKind.STATION, 0, 1, (within,), area=within, station=StationKind.STACK, room=9)

    entities = [
        area(A1, "Area 1", 30, L3), lane(L3, "Lane 3", 10, C1),
        Entity(C1, "Crossing 1", EntityKind.CROSSING, 5, 0, (L2, A2), turns=((L11, A2, 6),)),
        lane(L2, "Lane 2", 12, A4), area(A4, "Area 4", 10, L11, S2), lane(L11, "Lane 11", 20, C1),
        area(A2, "Area 2", 6, C1, S1), station(S2, "Station 2", A4), station(S1, "Station 1", A2),
    ]  # fmt: skip
    machines = {1: Machine(1, "desk", KindCode.DESK, Segment(0, 0))}
    machines |= {10 + n: Machine(10 + n, f"R{n}", KindCode.VEHICLE, Segment(A1, 1)) for n in range(1, vehicles + 1)}
    return Terminal(
        name="fig3",
        digest=1,
        bitrate=500_000,
        machines=machines,
        timing=TIMING,
        entities={one.number: one for one in entities},
        boxes=tuple(Box(f"B{n}", "T1", S2) for n in range(1, 5)),
        dock_us=2,
        handle_us=2,
        undock_us=2,
        gap_us=1,
        horizon_us=60,
        patience_us=30,
    )


def plan_of(site: Terminal, owner: int, box: int = 3, begin: int = 10, before: int = 0) -> ActionPlan:
    """The printed plan, its dates not yet propagated."""
    steps = [
        *drive_steps(site, OUT), *handling_steps(site, S2, Action.PICK_UP),
        *drive_steps(site, BACK, S2), *handling_steps(site, S1, Action.PUT_DOWN),
    ]  # fmt: skip
    return ActionPlan(owner, 1, begin, tuple(steps), (Load(box, NO_REFERENCE, 6, 13, before),))


def behind(plan: ActionPlan, owner: int) -> ActionPlan:
    """The same, after another machine wherever that goes."""
    steps = [step._replace(after=EntityStay(owner, number)) for number, step in enumerate(plan.steps)]
    return replace(plan, steps=tuple(steps))


def intervals(traffic: Traffic, owner: int, now: int) -> list[tuple[int, int]]:
    """[st et] of each step that is left."""
    dates, owned = traffic.dates(now).at, traffic.plans[owner]
    numbers = range(owned.current, len(owned.plan.steps))
    return [(dates[StepDate(owner, number)], dates[StepDate(owner, number + 1)]) for number in numbers]
