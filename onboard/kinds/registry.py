"""Which behaviour drives which kind of machine: the one place to add a kind to the image."""

from onboard.core.behaviour import BehaviourFactory
from onboard.core.codes import KindCode
from onboard.kinds.car_park.compartment import CompartmentFactory
from onboard.kinds.car_park.lift import LiftFactory
from onboard.kinds.car_park.robot import RobotFactory

_FACTORIES: dict[KindCode, BehaviourFactory] = {
    KindCode.ROBOT: RobotFactory(),
    KindCode.COMPARTMENT: CompartmentFactory(),
    KindCode.LIFT: LiftFactory(),
}


def factory_for(kind: KindCode) -> BehaviourFactory:
    """The factory of one kind. Raises ``KeyError`` for a kind that this image cannot drive."""
    return _FACTORIES[kind]
