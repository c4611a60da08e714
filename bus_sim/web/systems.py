"""What a person can do at sites of the other systems: one more of the site's own orders, and a lane that is blocked."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, cast

from bus_sim.run import BusRun
from bus_sim.systems.cell.plant import CellPlant
from bus_sim.systems.graph.plant import GraphPlant
from bus_sim.systems.terminal.plant import TerminalPlant
from bus_sim.systems.turning.plant import TurningPlant
from bus_sim.web.run_source import Act, Arguments, RunSource
from onboard.systems.terminal.site import Blockage, EntityKind
from onboard.web.app import CommandError


def source_of(run: BusRun) -> RunSource:
    """The source of a run of any system but the car park."""
    source = RunSource(run)
    source.acts.update(_acts(run, source))
    return source


def _acts(run: BusRun, source: RunSource) -> Mapping[str, Act]:
    plant = run.plant
    match plant:
        case TerminalPlant():
            return {"block": partial(_block, plant), "clear": partial(_free, plant)}
        case GraphPlant() if plant.site.orders:
            return {"order": partial(_order, source, plant.counters, plant.site.orders)}
        case CellPlant() if plant.site.wishes:
            return {"order": partial(_order, source, plant.counters, plant.site.wishes)}
        case TurningPlant() if plant.site.orders:
            return {"order": partial(_order, source, plant.counters, plant.site.orders)}
    return {}


def _order(source: RunSource, counters: Mapping[int, Any], wanted: Sequence[object], _: Arguments) -> str:
    """One of the site's own orders once more, drawn by chance, at a desk drawn by chance."""
    desk = source.chance.choice(sorted(counters))
    cast("Callable[[object], None]", counters[desk].add)(source.chance.choice(wanted))
    return f"order {len(counters[desk].entries)} comes to {source.picture.view.name(desk)}"


def _lane(plant: TerminalPlant, arguments: Arguments) -> int:
    entity = plant.site.by_name.get(str(arguments.get("place")))
    if entity is None or entity.kind is not EntityKind.LANE:
        names = ", ".join(one.name for one in plant.site.entities.values() if one.kind is EntityKind.LANE)
        raise CommandError(f"{arguments.get('place')}: no lane of this site; there are {names}")
    return entity.number


def _block(plant: TerminalPlant, arguments: Arguments) -> str:
    lane = _lane(plant, arguments)
    plant.block(Blockage(lane, plant.now_us(), 0))
    return f"something lies on {plant.site.entities[lane].name}"


def _free(plant: TerminalPlant, arguments: Arguments) -> str:
    lane = _lane(plant, arguments)
    plant.free(lane)
    return f"{plant.site.entities[lane].name} is free again"
