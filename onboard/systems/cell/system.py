"""A manufacturing cell: arms and the goal desk."""

from onboard.contract.codes import KindCode
from onboard.systems.cell.desk import GoalManagerFactory
from onboard.systems.cell.records import RECORDS
from onboard.systems.cell.robot import ArmFactory
from onboard.systems.cell.site import Cell
from onboard.systems.system import System

SYSTEM = System(Cell.system, {KindCode.ARM: ArmFactory(), KindCode.DESK: GoalManagerFactory()}, records=RECORDS)
