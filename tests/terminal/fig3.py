"""The network that Fig. 3 of the paper implies, in whole seconds, and the plan printed there."""

from dataclasses import replace

from onboard.core.codes import KindCode
from onboard.core.messages import NO_REFERENCE
from onboard.core.site import Machine, Segment, Timing
from onboard.kinds.terminal.messages import Action
from onboard.kinds.terminal.plan import Load, Plan, drive_steps, handling_steps
from onboard.kinds.terminal.site import Box, Entity, EntityKind, StationKind, Terminal
from onboard.kinds.terminal.traffic import Node, Traffic

A1, L3, C1, L2, A4, L11, A2, S2, S1 = 1, 2, 3, 4, 5, 6, 7, 8, 9
TIMING = Timing(0, 0, 1, 0, 1, 0, 0, 0, 0, 0, 0, 0)
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
    lane = {"capacity": lane_capacity, "kind": EntityKind.LANE}
    area = {"capacity": 0, "kind": EntityKind.AREA}
    station = {"capacity": 1, "kind": EntityKind.STATION, "station": StationKind.STACK}
    entities = [
        Entity(A1, "A1", duration_us=30, leads_to=(L3,), **area),  # type: ignore[arg-type]  # a row of a table
        Entity(L3, "L3", duration_us=10, leads_to=(C1,), **lane),  # type: ignore[arg-type]
        Entity(C1, "C1", EntityKind.CROSSING, 5, 0, (L2, A2), turns=((L11, A2, 6),)),
        Entity(L2, "L2", duration_us=12, leads_to=(A4,), **lane),  # type: ignore[arg-type]
        Entity(A4, "A4", duration_us=10, leads_to=(L11, S2), **area),  # type: ignore[arg-type]
        Entity(L11, "L11", duration_us=20, leads_to=(C1,), **lane),  # type: ignore[arg-type]
        Entity(A2, "A2", duration_us=6, leads_to=(C1, S1), **area),  # type: ignore[arg-type]
        Entity(S2, "S2", duration_us=0, leads_to=(A4,), area=A4, **station),  # type: ignore[arg-type]
        Entity(S1, "S1", duration_us=0, leads_to=(A2,), area=A2, **station),  # type: ignore[arg-type]
    ]
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


def plan_of(site: Terminal, owner: int, box: int = 3, begin: int = 10, before: int = 0) -> Plan:
    """The printed plan, its dates not yet propagated."""
    steps = [
        *drive_steps(site, OUT), *handling_steps(site, S2, Action.PICK_UP),
        *drive_steps(site, BACK, S2), *handling_steps(site, S1, Action.PUT_DOWN),
    ]  # fmt: skip
    return Plan(owner, 1, begin, tuple(steps), (Load(box, NO_REFERENCE, 6, 13, before),))


def behind(plan: Plan, owner: int) -> Plan:
    """The same, after another machine wherever that goes."""
    steps = [step._replace(after=(owner, number)) for number, step in enumerate(plan.steps)]  # type: ignore[arg-type]
    return replace(plan, steps=tuple(steps))


def intervals(traffic: Traffic, owner: int, now: int) -> list[tuple[int, int]]:
    """[st et] of each step that is left."""
    dates, owned = traffic.dates(now).at, traffic.plans[owner]
    numbers = range(owned.current, len(owned.plan.steps))
    return [(dates[Node(owner, number)], dates[Node(owner, number + 1)]) for number in numbers]
