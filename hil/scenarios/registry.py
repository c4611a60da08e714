"""Every scenario by name."""

from bus_sim.systems.registry import simulated, simulated_names
from hil.bench import Capability
from hil.scenarios.abuse import refuses_duplicate_node_id, refuses_wrong_site, survives_flood
from hil.scenarios.recovery import leaves_bus_off, survives_reset, survives_unplugging
from hil.scenarios.scenario import BenchScenario
from hil.scenarios.work import bids, joins, moves, takes, wins, yields
from hil.stage import TestBench
from onboard.contract.codes import KindCode, Reason

_ROBOT = frozenset({KindCode.ROBOT})
#: Kinds that carry out what comes, of every system.
_WORKERS = frozenset(one for one in (simulated(name).worker for name in simulated_names()) if one is not None)
_BUS = frozenset({Capability.FLEET_BUS})
_WORK = frozenset({Capability.FLEET_BUS, Capability.DEVICE_BUS})
#: What a machine drops when others' words reach it late or in part.
_LATE = frozenset({Reason.LATE, Reason.INCOMPLETE_SET, Reason.TOKEN_STALE_VERSION})


async def _bids(stage: TestBench) -> None:
    await bids(stage)


SCENARIOS: tuple[BenchScenario, ...] = (
    BenchScenario("joins", joins, _BUS),
    BenchScenario("bids", _bids, _WORK, _WORKERS),
    BenchScenario("takes what it won", takes, _WORK, _WORKERS),
    BenchScenario("wins", wins, _WORK, _ROBOT),
    BenchScenario("moves under authority", moves, _WORK, _ROBOT),
    # The bench itself tells the other robot's plan, and nobody answers for its tokens.
    BenchScenario("yields", yields, _WORK, _ROBOT, late=True),
    BenchScenario("survives a reset", survives_reset, _WORK | {Capability.POWER}, _ROBOT, drops=_LATE, late=True),
    BenchScenario("leaves bus-off", leaves_bus_off, _BUS | {Capability.BUS_OFF}, drops=_LATE, wire_errors=True),
    BenchScenario(
        "survives unplugging", survives_unplugging, _BUS | {Capability.CABLE}, drops=_LATE, wire_errors=True, late=True
    ),
    # Two nodes with one identifier and other data destroy each other's frames where they meet.
    BenchScenario(
        "refuses a duplicate node-ID",
        refuses_duplicate_node_id,
        _BUS | {Capability.CONSOLE},
        drops=frozenset({Reason.DUPLICATE_NODE_ID}),
        wire_errors=True,
        late=True,
    ),
    BenchScenario(
        "refuses another site's file",
        refuses_wrong_site,
        _WORK | {Capability.FILES},
        _WORKERS,
        rivals=True,
        drops=frozenset({Reason.OTHER_SITE}),
        late=True,
    ),
    BenchScenario(
        "survives a flood",
        survives_flood,
        _WORK,
        _WORKERS,
        drops=_LATE | {Reason.UNKNOWN_IDENTIFIER},
        late=True,
    ),
)
