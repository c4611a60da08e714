"""Pick-up and delivery on a floor of cells: robots and the order desk."""

from onboard.contract.codes import KindCode
from onboard.systems.mapd.factories import OrderDeskFactory, UnitRobotFactory
from onboard.systems.mapd.records import RECORDS
from onboard.systems.mapd.site import Mapd
from onboard.systems.system import System

SYSTEM = System(
    Mapd.system,
    {KindCode.VEHICLE: UnitRobotFactory(), KindCode.DESK: OrderDeskFactory()},
    records=RECORDS,
)
