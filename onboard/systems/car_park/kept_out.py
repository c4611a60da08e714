"""A robot that stands loaded before a bay in which another car is: it must not stand in the way of whoever takes that.

A bay is promised to the next car while it still works, and what was planned may not come true: a driver takes his time,
or the robot for the car in the bay is lost, and who stands outside is the only one left; or a compartment that lost its
journal has called for another car since. Then it leaves its car at a free place, and the compartment calls for that
anew.
"""

from dataclasses import dataclass

from onboard.contract.codes import LegAction
from onboard.contract.messages import Itinerary
from onboard.core.authority import station_token
from onboard.core.site import Station
from onboard.systems.car_park import custody
from onboard.systems.car_park.handling import ShuttleWork
from onboard.systems.car_park.program import CarHandling, HandlingPhase, Program, StationWork
from onboard.systems.car_park.site import car_park
from onboard.ways.mirror import WayFleet, WayMirror

#: So long it stands where another robot is to take the car away, us.
ROBOT_PATIENCE_US = 10_000_000
#: So long where a driver is to go with it, us, beside the doors: both open for him, and close behind him.
DRIVER_PATIENCE_US, DRIVERS_DOORS = 48_000_000, 4
#: And so long before an empty bay whose right it does not get, us, beside its doors: a driver walks out for 8 s.
REFUSED_PATIENCE_US, EMPTY_DOORS = 36_000_000, 3


@dataclass
class KeptOut:
    """One robot's look at the bay where it is to leave its car."""

    fleet: WayFleet
    shuttle: ShuttleWork
    _since_us: int | None = None
    _due_us: int | None = None

    def _is_kept_out(self, work: StationWork) -> bool:
        """Whether it cannot be done for now: another car stands in the bay where one is to be left, or has the bay."""
        if work.handling is not CarHandling.LEAVE or work.station not in self.fleet.site.compartments.values():
            return False
        return self._has_another(work) or not self.fleet.tokens.holds(station_token(work.station))

    def _has_another(self, work: StationWork) -> bool:
        return bool(custody.others_in(self.fleet.mirror, work.station, work.car))

    def next_wake(self) -> int | None:
        """When to look again, bus us."""
        return self._due_us

    def look(self, program: Program, now_us: int) -> StationWork | None:
        """The work before whose bay this robot has stood for long enough; it is looked at anew after that."""
        step = program.step
        work = None if step is None else step.work
        stands = work is not None and self.shuttle.work == work and self.shuttle.phase is HandlingPhase.ACQUIRE
        if work is None or not stands or not self._is_kept_out(work):
            self._since_us = self._due_us = None
            return None
        self._since_us = now_us if self._since_us is None else self._since_us
        patience_us = self._patience_us(work)
        self._due_us = self._since_us + patience_us
        if now_us < self._due_us:
            return None
        self._since_us, self._due_us = now_us, now_us + patience_us
        return work

    def _patience_us(self, work: StationWork) -> int:
        door_us = car_park(self.fleet.site).timing.door_us
        if not self._has_another(work):
            return REFUSED_PATIENCE_US + EMPTY_DOORS * door_us
        return ROBOT_PATIENCE_US if self._is_wanted(work.station) else DRIVER_PATIENCE_US + DRIVERS_DOORS * door_us

    def _is_wanted(self, bay: Station) -> bool:
        """Whether another robot plans to take the car out of the bay; whoever brought it there has done so already."""
        mirror = self.fleet.mirror
        others = [plan for plan in mirror.itineraries.values() if plan.sender != self.fleet.node_id]
        return any(will_work(mirror, plan, bay) for plan in others)


def will_work(mirror: WayMirror, plan: Itinerary, station: Station) -> bool:
    """Whether a plan has work at a station that is not behind its machine by that one's own word."""
    told = mirror.progress.get(plan.sender)
    behind = told.leg if told is not None and told.itinerary_version == plan.version else 0
    return any(
        leg.action is LegAction.WORK
        and (leg.track, leg.to_index, leg.side) == (station.track, station.index, station.side)
        for leg in plan.legs[behind:]
    )
