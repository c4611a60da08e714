"""A turning cell: lathes and the order desk."""

from onboard.contract.codes import KindCode
from onboard.systems.system import System
from onboard.systems.turning.desk import BatchDeskFactory
from onboard.systems.turning.machine import LatheFactory
from onboard.systems.turning.records import RECORDS
from onboard.systems.turning.site import Turning

SYSTEM = System(Turning.system, {KindCode.LATHE: LatheFactory(), KindCode.DESK: BatchDeskFactory()}, records=RECORDS)
