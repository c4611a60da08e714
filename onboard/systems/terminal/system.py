"""A container terminal: vehicles and the mission desk."""

from onboard.contract.codes import KindCode
from onboard.systems.system import System
from onboard.systems.terminal.desk import TerminalDeskFactory
from onboard.systems.terminal.records import RECORDS
from onboard.systems.terminal.site import Terminal
from onboard.systems.terminal.vehicle import VehicleFactory

SYSTEM = System(
    Terminal.system,
    {KindCode.VEHICLE: VehicleFactory(), KindCode.DESK: TerminalDeskFactory()},
    records=RECORDS,
)
