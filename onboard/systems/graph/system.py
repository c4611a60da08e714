"""A factory graph: robots, the nodes that host their agents, and the desk."""

from onboard.contract.codes import KindCode
from onboard.systems.graph.agents import HostFactory
from onboard.systems.graph.desk import VisitDeskFactory
from onboard.systems.graph.records import RECORDS
from onboard.systems.graph.robot import GraphRobotFactory
from onboard.systems.graph.site import FactoryGraph
from onboard.systems.system import System

SYSTEM = System(
    FactoryGraph.system,
    {KindCode.VEHICLE: GraphRobotFactory(), KindCode.NODE: HostFactory(), KindCode.DESK: VisitDeskFactory()},
    records=RECORDS,
)
