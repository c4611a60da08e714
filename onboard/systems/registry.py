"""Which behaviour drives which kind of machine, system by system: the one place to add a system or a kind to the image.

docs/new-kind.md shows how.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial

from onboard.core.behaviour import BehaviourFactory
from onboard.core.codes import KindCode
from onboard.core.compaction import Entry, Rules, compact
from onboard.core.messages import Message
from onboard.core.site import Site
from onboard.systems.car_park.compartment_factory import CompartmentFactory
from onboard.systems.car_park.lift_factory import LiftFactory
from onboard.systems.car_park.records import RECORDS as CAR_PARK_RECORDS
from onboard.systems.car_park.robot import RobotFactory
from onboard.systems.car_park.site import CarPark
from onboard.systems.cell.desk import DeskFactory as GoalDeskFactory
from onboard.systems.cell.messages import MESSAGES as CELL_MESSAGES
from onboard.systems.cell.records import RECORDS as CELL_RECORDS
from onboard.systems.cell.robot import ArmFactory
from onboard.systems.cell.site import Cell
from onboard.systems.graph.agents import HostFactory
from onboard.systems.graph.desk import DeskFactory as VisitDeskFactory
from onboard.systems.graph.messages import MESSAGES as GRAPH_MESSAGES
from onboard.systems.graph.records import RECORDS as GRAPH_RECORDS
from onboard.systems.graph.robot import RobotFactory as GraphRobotFactory
from onboard.systems.graph.site import FactoryGraph
from onboard.systems.mapd.factories import OrderDeskFactory as CallDeskFactory
from onboard.systems.mapd.factories import UnitRobotFactory
from onboard.systems.mapd.messages import MESSAGES as MAPD_MESSAGES
from onboard.systems.mapd.records import RECORDS as MAPD_RECORDS
from onboard.systems.mapd.site import Mapd
from onboard.systems.terminal.desk import DeskFactory as MissionDeskFactory
from onboard.systems.terminal.messages import MESSAGES as TERMINAL_MESSAGES
from onboard.systems.terminal.records import RECORDS as TERMINAL_RECORDS
from onboard.systems.terminal.site import Terminal
from onboard.systems.terminal.vehicle import VehicleFactory
from onboard.systems.turning.desk import DeskFactory as OrderDeskFactory
from onboard.systems.turning.machine import LatheFactory
from onboard.systems.turning.messages import MESSAGES as TURNING_MESSAGES
from onboard.systems.turning.records import RECORDS as TURNING_RECORDS
from onboard.systems.turning.site import Turning


@dataclass(frozen=True, slots=True)
class System:
    """One kind of site. ``messages`` are the classes of what ``dbc/<name>.dbc`` adds to the contracts of all."""

    name: str
    factories: Mapping[KindCode, BehaviourFactory]
    messages: tuple[type[Message], ...] = ()
    #: What of its journal records outlives compaction, beside the core's own; what is not named is kept for good.
    records: Rules = field(default_factory=dict)


_SYSTEMS: dict[str, System] = {
    system.name: system
    for system in (
        System(
            CarPark.system,
            {KindCode.ROBOT: RobotFactory(), KindCode.COMPARTMENT: CompartmentFactory(), KindCode.LIFT: LiftFactory()},
            records=CAR_PARK_RECORDS,
        ),
        System(
            FactoryGraph.system,
            {
                KindCode.VEHICLE: GraphRobotFactory(),
                KindCode.NODE: HostFactory(),
                KindCode.DESK: VisitDeskFactory(),
            },
            GRAPH_MESSAGES,
            GRAPH_RECORDS,
        ),
        System(
            Terminal.system,
            {KindCode.VEHICLE: VehicleFactory(), KindCode.DESK: MissionDeskFactory()},
            TERMINAL_MESSAGES,
            TERMINAL_RECORDS,
        ),
        System(
            Cell.system, {KindCode.ARM: ArmFactory(), KindCode.DESK: GoalDeskFactory()}, CELL_MESSAGES, CELL_RECORDS
        ),
        System(
            Turning.system,
            {KindCode.LATHE: LatheFactory(), KindCode.DESK: OrderDeskFactory()},
            TURNING_MESSAGES,
            TURNING_RECORDS,
        ),
        System(
            Mapd.system,
            {KindCode.VEHICLE: UnitRobotFactory(), KindCode.DESK: CallDeskFactory()},
            MAPD_MESSAGES,
            MAPD_RECORDS,
        ),
    )
}


def add_system(system: System) -> None:
    """One more system in this process, such as one that is being tried. Raises ``ValueError`` for a name twice."""
    if system.name in _SYSTEMS:
        raise ValueError(f"system {system.name}: there is one of this name")
    _SYSTEMS[system.name] = system


def remove_system(name: str) -> None:
    """Take out what ``add_system`` put in. Raises ``KeyError``."""
    del _SYSTEMS[name]


def system_of(site: Site) -> System:
    """The system of a site. Raises ``KeyError`` for one that this image does not know."""
    return _SYSTEMS[site.system]


def factory_for(site: Site, kind: KindCode) -> BehaviourFactory:
    """The factory of one kind of machine. Raises ``KeyError`` for a kind that this image cannot drive there."""
    return system_of(site).factories[kind]


def compaction_for(site: Site) -> Callable[[list[Entry]], list[Entry]]:
    """What a journal of this site may leave out: entries in, those that still mean something out."""
    return partial(compact, system_of(site).records)
