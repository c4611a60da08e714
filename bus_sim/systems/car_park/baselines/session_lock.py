"""The session lock of other systems as a baseline: a lift is one robot's from its call to its leaving.

A robot calls the lift when it sets out for it, with nothing to do on the way but travel and wait; a call during
another's session is answered when that ends. Until the robot has left the platform nobody else may plan a ride in
between. Plant, controllers, protocol and planner are the same: only the reservations that robots plan around differ.
Never in the normal path: put ``factories`` into a simulation before it starts.
"""

from collections.abc import Iterable

from onboard.contract.codes import KindCode, LegAction
from onboard.contract.messages import Itinerary
from onboard.core.behaviour import BehaviourFactory
from onboard.core.mirror import Mirror
from onboard.core.serial import from_bus_ms
from onboard.core.site import Machine, Site
from onboard.systems.car_park.generation import CarParkGeneration
from onboard.systems.car_park.robot import ParkingRobotFactory
from onboard.systems.registry import factory_for
from onboard.ways.lifts import platform
from onboard.ways.mirror import way_mirror
from onboard.ways.reservations import Reservations, SlotWindow, Use


class SessionLocks(Reservations):
    """Reservations in which each use of a lift begins with the robot's call for it."""

    def __init__(self, mirror: Mirror) -> None:
        super().__init__()
        self._mirror = mirror

    def reserve(self, owner: int, windows: Iterable[SlotWindow], uses: Iterable[Use] = ()) -> None:
        """As the base, with the time from the call to boarding added to each use, and to the platform's windows."""
        sessions = [use._replace(from_us=self._session_begin_us(owner, use)) for use in uses]
        locks = [
            SlotWindow(platform(session.lift_track), session.from_us, session.to_us)
            for session in sessions
            if session.from_us < session.to_us
        ]
        super().reserve(owner, [*windows, *locks], sessions)

    def _session_begin_us(self, owner: int, use: Use) -> int:
        itinerary = self._mirror.itineraries.get(owner)
        if itinerary is None:
            return use.from_us
        call_us = _call_us(itinerary, use)
        ended_us = [other.to_us for other in self.uses(use.lift_track, excluding=owner) if other.to_us <= use.from_us]
        return min(use.from_us, max([call_us, *ended_us]))


def _call_us(itinerary: Itinerary, use: Use) -> int:
    """When the way to the lift begins: behind the last work or ride before the use."""
    call_us = from_bus_ms(itinerary.stamp.award_ms, use.from_us)
    for leg in itinerary.legs:
        end_us = from_bus_ms(leg.end_ms, use.from_us)
        if end_us > use.from_us:
            break
        if leg.action in (LegAction.WORK, LegAction.RIDE):
            call_us = end_us
    return call_us


class LockingRobotFactory(ParkingRobotFactory):
    """Makes robots that see a lift as taken for the whole of a session."""

    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> CarParkGeneration:
        """The robot's task-generation function, around sessions."""
        way_mirror(mirror).reservations = SessionLocks(mirror)
        return super().estimator(site, machine, mirror)


def factories(site: Site, kind: KindCode) -> BehaviourFactory:
    """The factory of one kind, robots with session locks."""
    return LockingRobotFactory() if kind is KindCode.ROBOT else factory_for(site, kind)
