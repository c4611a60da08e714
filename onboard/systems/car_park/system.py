"""A robotized car park: robots, lifts and compartments."""

from onboard.contract.codes import KindCode
from onboard.systems.car_park.compartment_factory import CompartmentFactory
from onboard.systems.car_park.lift_factory import LiftFactory
from onboard.systems.car_park.records import RECORDS
from onboard.systems.car_park.robot import ParkingRobotFactory
from onboard.systems.car_park.site import CarPark
from onboard.systems.system import System

SYSTEM = System(
    CarPark.system,
    {KindCode.ROBOT: ParkingRobotFactory(), KindCode.COMPARTMENT: CompartmentFactory(), KindCode.LIFT: LiftFactory()},
    records=RECORDS,
)
