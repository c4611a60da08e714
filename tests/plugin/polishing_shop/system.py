"""A polishing shop: a desk and its polishers."""

from onboard.contract.codes import KindCode
from onboard.systems.system import System
from polishing_shop.machines import DeskFactory, PolisherFactory
from polishing_shop.site import Shop

SYSTEM = System(Shop.system, {KindCode.LATHE: PolisherFactory(), KindCode.DESK: DeskFactory()})
