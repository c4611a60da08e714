"""The container terminal, for the tests of every system."""

from bus_sim.sites import find_site
from bus_sim.systems.orders import OrderArrivals
from onboard.contract.codes import TokenKind
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import CarAt, Reference, TokenHeld
from onboard.contract.terminal import Action, HandlerMode, MoveMode, PlanHead, PlanStep, StepReport, StepResult
from onboard.contract.terminal_device import HandlerState, MoveOrder, MoveState
from onboard.systems.terminal.vehicle import terminal
from tests.conformance.case import Case
from tests.terminal.seeds import short

_ENTITY = {name: one.number for name, one in terminal(find_site("terminal")).by_name.items()}
L3, C1, A1, A4, S2 = (_ENTITY[name] for name in ("L3", "C1", "A1", "A4", "S2"))
BOX = Reference(1, 4)


def _in(vehicle: int, entity: int, slot: int) -> MoveState:
    return MoveState(vehicle, 1, entity, slot, MoveMode.STANDING, at_end=True)


def _plan(vehicle: int, *steps: tuple[int, int]) -> list[PlanHead | PlanStep]:
    """Steps as (entity, end in ms)."""
    told = [PlanStep(vehicle, 1, number, Action.GOTO, *one, 0, 0) for number, one in enumerate(steps)]
    return [PlanHead(vehicle, 1, len(steps), 0, 0), *told]


def _done(vehicle: int, step: int, entity: int) -> StepReport:
    return StepReport(vehicle, 1, step, StepResult.DONE, entity, 0)


_THROUGH = ((A1, 1_000), (L3, 2_000), (C1, 3_000))
CASE = Case(
    system="terminal",
    site="terminal",
    options=("--for", "150"),
    busy=short,
    struck_s=lambda _: (16.0, 80.0),
    limit_s=900,
    orders=OrderArrivals(2, 30.0),
    parties=(1, 11, 12),
    broken={
        "one-body-a-slot": [[_in(11, L3, 2), _in(12, L3, 2)], [_in(11, S2, 1), _in(12, S2, 2)]],
        "moves-by-right": [[TokenHeld(12, TokenKind.SEGMENT, L3 << 8 | 1, 3), MoveOrder(11, 1, L3, 1, C1)]],
        "box-in-one-place": [
            [HandlerState(one, 1, HandlerMode.FREE, 4) for one in (11, 12)],
            [TokenHeld(12, TokenKind.CAR, BOX.origin << 16 | BOX.number, 3), CarAt(11, BOX, ANY_STATION, 1, 0)],
        ],
        "nobody-overtakes": [
            [*_plan(11, *_THROUGH), *_plan(12, *_THROUGH), _done(11, 0, A1), _done(12, 0, A1), _done(12, 1, L3)]
        ],
        "plans-in-order": [_plan(11, (A1, 2_000), (L3, 1_000)), _plan(11, (A1, 1_000), (A4, 2_000))],
    },
    words=(
        ["transport box B4", "S2 to S10"],
        ["drives through L"],
        ["token slot 1 of L3", "box B7", "lane L11"],
    ),
    drawn=["L11", "A4", "S10", "R1", "R4", "blocked"],
)
