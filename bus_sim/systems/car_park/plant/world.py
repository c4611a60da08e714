"""Ground truth: where every body and car is, how doors stand, who is inside.

Devices and people change the world through the methods below; each change is told to all watchers, in the order in
which they came. The world permits everything that its bookkeeping can express, hazards included: interlocks belong
to the devices, and judging belongs to the oracle, so that a device without its interlock is found out.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

from bus_sim.devices.timers import Timers
from bus_sim.systems.car_park.plant.bodies import Aboard, CarBody, Location
from bus_sim.systems.car_park.plant.motion import Motion, standing
from bus_sim.systems.car_park.plant.rules import PlantRule
from bus_sim.systems.car_park.plant.shaft import PlatformBody, Sill, sills_of
from onboard.contract.codes import DoorName, DoorPosition, KindCode, Side
from onboard.core.site import Segment, Station
from onboard.systems.car_park.axis import TrackAxis
from onboard.ways.lifts import is_same_stop, nearest_stop, stop_mm
from onboard.ways.site import WaySite

#: Tolerance of the fine position sensor opposite a station, mm (row P34).
MARK_TOLERANCE_MM = 5.0


def is_at_mark(position_mm: float, pitch_mm: float) -> bool:
    """Whether a position is within the fine sensor's tolerance of a mark; marks are ``pitch_mm`` apart, one at 0."""
    return abs(position_mm - round(position_mm / pitch_mm) * pitch_mm) <= MARK_TOLERANCE_MM


class WorldChange(Enum):
    """What kind of thing changed."""

    CARRIER = "carrier"
    SHUTTLE = "shuttle"
    DOOR = "door"
    PERSON = "person"
    CAR = "car"
    PLATFORM = "platform"


#: Called after a change with its kind, the node-ID of the machine it happened at, and the time in us.
Watcher = Callable[[WorldChange, int, int], None]


@dataclass
class RobotBody:
    """A robot as it is: its carrier on a track and its shuttle's extension (mm from home, towards ``side``).

    From the end of a turn into a track to the end of the turn out of it the track is that one, the mouth one pitch
    beyond its end. ``turning_to`` is the track towards which a carrier turns now.
    """

    track: int
    motion: Motion
    extension: Motion
    side: Side = Side.NEAR
    turning_to: int | None = None

    def is_out(self, now_us: int) -> bool:
        """Whether any part of the shuttle is outside the carrier, or about to be."""
        return now_us < self.extension.end_us or self.extension.final_mm > 0


@dataclass
class BayBody:
    """A compartment as it is. ``persons`` counts people inside; ``crossing`` a car with its body over the sill."""

    station: Station
    doors: dict[DoorName, DoorPosition] = field(
        default_factory=lambda: {DoorName.INPUT: DoorPosition.LOCKED, DoorName.OUTPUT: DoorPosition.LOCKED}
    )
    persons: int = 0
    crossing: bool = False


class CarParkWorld:
    """The site's bodies, cars, doors and people. Robots start standing at home, compartments empty and locked."""

    def __init__(self, site: WaySite, timers: Timers) -> None:
        self.site = site
        self.timers = timers
        self.robots: dict[int, RobotBody] = {}
        self.bays: dict[int, BayBody] = {}
        self.platforms: dict[int, PlatformBody] = {}
        self.sills: dict[int, dict[int, Sill]] = {}
        self.cars: dict[str, CarBody] = {}
        self.where: dict[str, Location] = {}
        self._watchers: list[Watcher] = []
        #: Told of orders that would do harm, though the device that was given them refused: who judges is told why.
        self.on_hazard: list[Callable[[PlantRule, str], None]] = []
        now_us = timers.now_us()
        for machine in site.machines.values():
            if machine.kind is KindCode.ROBOT:
                home = standing(float(site.position_mm(machine.home)), now_us)
                self.robots[machine.node_id] = RobotBody(machine.home.track, home, standing(0.0, now_us))
            elif machine.kind is KindCode.LIFT:
                start = standing(float(site.position_mm(machine.home)), now_us)
                self.platforms[machine.node_id] = PlatformBody(machine.home.track, start)
                self.sills[machine.node_id] = sills_of(site, machine.home.track)
            elif machine.kind is KindCode.COMPARTMENT and machine.station is not None:
                self.bays[machine.node_id] = BayBody(machine.station)

    def watch(self, watcher: Watcher) -> None:
        """Tell ``watcher`` of every change from now on."""
        self._watchers.append(watcher)

    # --- what is where -----------------------------------------------------------------------------------------

    def cars_at(self, location: Location) -> list[CarBody]:
        """The cars at one location, in the order in which they came into the world."""
        return [self.cars[name] for name, where in self.where.items() if where == location]

    def car_aboard(self, node_id: int) -> CarBody | None:
        """The car that a robot carries."""
        return next(iter(self.cars_at(Aboard(node_id))), None)

    def bay_at(self, station: Station) -> int | None:
        """Node-ID of the compartment whose bay this station is."""
        return next((node for node, bay in self.bays.items() if bay.station == station), None)

    def axis_of(self, node_id: int) -> int:
        """The track on whose axis a robot's position is: its own, and while it rides the alley where it boarded."""
        riding = (platform.axis for platform in self.platforms.values() if platform.robot == node_id)
        return next(riding, self.robots[node_id].track)

    def at_mark(self, node_id: int) -> bool:
        """The fine sensor: whether a carrier's centre is opposite a mark, moving or not (row P34).

        Every segment has one, and every platform.
        """
        position_mm = self.robots[node_id].motion.at(self.timers.now_us())[0]
        return is_at_mark(position_mm, self.site.tracks[self.axis_of(node_id)].pitch_mm)

    def stands(self, node_id: int) -> bool:
        """Whether a carrier's motion is at its end, and it does not turn."""
        robot = self.robots[node_id]
        return robot.turning_to is None and self.timers.now_us() >= robot.motion.end_us

    def standing_position(self, node_id: int) -> Segment | None:
        """The mark at which a robot's carrier stands still; index 0 or length + 1 of an alley on a platform there.

        Turned in a mouth it is the index beyond the end of the track inside. None between marks, while it moves, and
        while it rides.
        """
        robot = self.robots[node_id]
        if self.is_riding(node_id) or not self.stands(node_id) or not self.at_mark(node_id):
            return None
        track = self.site.tracks[robot.track]
        index = round(robot.motion.final_mm / track.pitch_mm) + 1
        return Segment(robot.track, index) if 0 <= index <= track.length + 1 else None

    def standing_segment(self, node_id: int) -> Segment | None:
        """The segment at whose centre a robot's carrier stands still, within the fine sensor's tolerance."""
        position = self.standing_position(node_id)
        if position is None or not 1 <= position.index <= self.site.tracks[position.track].length:
            return None
        return position

    def slots_of(self, node_id: int) -> list[Segment]:
        """Slots that a robot's body is in, platforms among them."""
        axis, half_mm = TrackAxis(self.site, self.axis_of(node_id)), self.site.carrier_length_mm // 2 - 1
        centre_mm = round(self._at(node_id))
        return axis.overlapped(centre_mm - half_mm, centre_mm + half_mm)

    # --- mouths ------------------------------------------------------------------------------------------------

    def other_ways(self, node_id: int) -> tuple[Segment, ...]:
        """Where a carrier could be, turned: beyond the ends of the tracks in whose mouth it stands, or that mouth."""
        here = self.standing_position(node_id)
        if here is None:
            return ()
        mouth = self.site.mouths.get(here)
        return self.site.links.get(here, ()) if mouth is None else (mouth,)

    def other_doors(self, node_id: int) -> tuple[Segment, ...]:
        """The same platform under a standing carrier as the position beyond the sills of its other doors here."""
        here = self.standing_position(node_id)
        lift_track = None if here is None else self.site.platforms.get(here)
        return tuple(
            self.site.beyond(sill)
            for lift, platform in self.platforms.items()
            if platform.track == lift_track
            for sill in self.site.tracks[platform.track].joins
            if sill.track in self.platform_floors(lift)
        )

    def go_by(self, node_id: int, position: Segment) -> None:
        """A carrier that stands where two tracks have a position each is on the other one's axis from now on."""
        self.end_turn(node_id, position)

    def begin_turn(self, node_id: int, track: int) -> None:
        """A carrier begins to turn where it is, towards another track."""
        self.robots[node_id].turning_to = track
        self._tell(WorldChange.CARRIER, node_id)

    def end_turn(self, node_id: int, position: Segment) -> None:
        """A carrier has turned: it stands at a position of the other track."""
        robot = self.robots[node_id]
        robot.track, robot.turning_to = position.track, None
        robot.motion = standing(float(self.site.position_mm(position)), self.timers.now_us())
        self._tell(WorldChange.CARRIER, node_id)

    # --- lifts -------------------------------------------------------------------------------------------------

    def platform_floor(self, node_id: int) -> int | None:
        """The floor at whose mark a lift's platform stands still, None while it is between floors or moves."""
        return next(iter(self.platform_floors(node_id)), None)

    def platform_floors(self, node_id: int) -> tuple[int, ...]:
        """The tracks to which the doors lead where a lift's platform stands still; empty while it does not."""
        platform = self.platforms[node_id]
        if self.timers.now_us() < platform.motion.end_us:
            return ()
        number, height_mm = platform.track, platform.motion.final_mm
        index = nearest_stop(self.site, number, height_mm)
        if abs(height_mm - stop_mm(self.site, number, index)) > MARK_TOLERANCE_MM:
            return ()
        sills = enumerate(self.site.tracks[number].joins, start=1)
        return tuple(sill.track for other, sill in sills if is_same_stop(self.site, number, index, other))

    def limits_mm(self, floor: int) -> tuple[float, float]:
        """How far a carrier may drive on a track now: onto a platform only where one stands there."""
        track = self.site.tracks[floor]
        low_mm, high_mm = 0.0, float((track.length - 1) * track.pitch_mm)
        low_mm -= track.pitch_mm * (track.low is not None)
        high_mm += track.pitch_mm * (track.high is not None)
        for node_id in self.platforms:
            if floor in self.platform_floors(node_id):
                centre_mm = self.sills[node_id][floor].centre_mm
                low_mm, high_mm = min(low_mm, centre_mm), max(high_mm, centre_mm)
        return low_mm, high_mm

    def on_platform(self, node_id: int) -> int | None:
        """The robot whose body is wholly on a lift's platform, at its mark or not, moving or not."""
        riding, length_mm = self.platforms[node_id].robot, self.site.carrier_length_mm
        if riding is not None:
            return riding
        for floor in self.platform_floors(node_id):
            centre_mm = self.sills[node_id][floor].centre_mm
            play_mm = max(MARK_TOLERANCE_MM, (self.site.tracks[floor].pitch_mm - length_mm) / 2)
            for node in self._on(floor):
                if abs(self._at(node) - centre_mm) <= play_mm:
                    return node
        return None

    def aboard(self, node_id: int) -> int | None:
        """The robot that stands wholly on a lift's platform, at its mark."""
        robot_id = self.on_platform(node_id)
        if robot_id is None or not self.stands(robot_id) or not self.at_mark(robot_id):
            return None
        return robot_id

    def overhang(self, node_id: int) -> int | None:
        """The robot whose body is over the sill of a lift at the floor where its platform stands."""
        length_mm = self.site.carrier_length_mm
        for floor in self.platform_floors(node_id):
            sill = self.sills[node_id][floor]
            for node in self._on(floor):
                if 0 < sill.beyond_mm(self._at(node), length_mm) < length_mm:
                    return node
        return None

    def next_crossing_us(self, node_id: int) -> int | None:
        """When, at the earliest, a body that is moving now begins or ends to be over the sill of a lift."""
        now_us, half_mm = self.timers.now_us(), self.site.carrier_length_mm / 2
        times = []
        for floor in self.platform_floors(node_id):
            edge_mm = self.sills[node_id][floor].edge_mm
            motions = [self.robots[node].motion for node in self._on(floor)]
            times += [one.next_reach_us(edge_mm + off_mm, now_us) for one in motions for off_mm in (-half_mm, half_mm)]
        # At the very microsecond of touching, nothing is over the sill yet.
        return min((time + 1 for time in times if time is not None), default=None)

    def is_riding(self, robot_id: int) -> bool:
        """Whether the platform under a carrier is between floors, moving or not."""
        return any(platform.robot == robot_id for platform in self.platforms.values())

    def move_platform(self, node_id: int, motion: Motion) -> None:
        """A platform's motion from now on; also called with a standing one when it has come to its end.

        Whoever is wholly on it rides, on the shaft's track, and is on that floor's alley when it stands at a floor.
        """
        platform = self.platforms[node_id]
        robot_id = self.on_platform(node_id)
        if robot_id is not None and platform.robot is None:
            platform.axis = self.robots[robot_id].track
        platform.motion = motion
        if robot_id is not None:
            self._carry(platform, self.sills[node_id], robot_id, self.platform_floors(node_id))
            self._tell(WorldChange.CARRIER, robot_id)
        self._tell(WorldChange.PLATFORM, node_id)

    def _carry(self, platform: PlatformBody, sills: dict[int, Sill], robot_id: int, floors: tuple[int, ...]) -> None:
        robot = self.robots[robot_id]
        if not floors:
            platform.robot, robot.track = robot_id, platform.track
            return
        floor = platform.axis if platform.axis in floors else floors[0]
        robot.motion = robot.motion.shifted(sills[floor].centre_mm - sills[platform.axis].centre_mm)
        platform.robot, robot.track = None, floor

    def _on(self, track: int) -> list[int]:
        return [node for node, robot in self.robots.items() if robot.track == track]

    def _at(self, robot_id: int) -> float:
        return self.robots[robot_id].motion.at(self.timers.now_us())[0]

    def station_beside(self, node_id: int, side: Side) -> Station | None:
        """The place or bay that a robot's shuttle would reach on one side; None for a wall, or between marks."""
        segment = self.standing_segment(node_id)
        if segment is None:
            return None
        station = Station(segment.track, segment.index, side)
        known = station in self.site.places or self.bay_at(station) is not None
        return station if known else None

    def shuttle_in(self, station: Station) -> int | None:
        """Node-ID of the robot whose shuttle is out towards a station."""
        now_us = self.timers.now_us()
        for node_id, robot in self.robots.items():
            if robot.is_out(now_us) and self.station_beside(node_id, robot.side) == station:
                return node_id
        return None

    def robot_before(self, station: Station) -> int | None:
        """Node-ID of the robot whose carrier stands opposite a station."""
        here = (node_id for node_id, robot in self.robots.items() if robot.track == station.track)
        return next((node_id for node_id in here if self.standing_segment(node_id) == station.segment), None)

    def carrier_in_front(self, station: Station) -> bool:
        """Whether a carrier stands opposite a station."""
        return self.robot_before(station) is not None

    # --- what changes ------------------------------------------------------------------------------------------

    def move_carrier(self, node_id: int, motion: Motion) -> None:
        """A carrier's motion from now on; also called with the same motion when it has come to its end."""
        self.robots[node_id].motion = motion
        self._tell(WorldChange.CARRIER, node_id)

    def move_shuttle(self, node_id: int, extension: Motion, side: Side) -> None:
        """A shuttle's extension from now on."""
        self.robots[node_id].extension = extension
        self.robots[node_id].side = side
        self._tell(WorldChange.SHUTTLE, node_id)

    def grip(self, node_id: int, station: Station) -> CarBody | None:
        """A shuttle lifts the car at a station; None where there is none."""
        cars = self.cars_at(station)
        if not cars:
            return None
        self.where[cars[0].name] = Aboard(node_id)
        self._tell(WorldChange.CAR, node_id)
        return cars[0]

    def put_down(self, node_id: int, station: Station) -> CarBody | None:
        """A shuttle puts its car down at a station; None where it carries none."""
        car = self.car_aboard(node_id)
        if car is None:
            return None
        self.where[car.name] = station
        self._tell(WorldChange.CAR, node_id)
        return car

    def set_door(self, node_id: int, door: DoorName, position: DoorPosition) -> None:
        """A compartment's door is in another position."""
        self.bays[node_id].doors[door] = position
        self._tell(WorldChange.DOOR, node_id)

    def person_enters(self, node_id: int) -> None:
        """A person crosses the sill of a compartment inwards."""
        self.bays[node_id].persons += 1
        self._tell(WorldChange.PERSON, node_id)

    def person_leaves(self, node_id: int) -> None:
        """A person crosses the sill outwards. Raises ``ValueError`` where nobody is inside."""
        if self.bays[node_id].persons == 0:
            raise ValueError(f"nobody is inside compartment {node_id}")
        self.bays[node_id].persons -= 1
        self._tell(WorldChange.PERSON, node_id)

    def begin_crossing(self, node_id: int) -> None:
        """A car begins to roll over the sill of a compartment, in or out."""
        self.bays[node_id].crossing = True
        self._tell(WorldChange.CAR, node_id)

    def car_enters(self, node_id: int, car: CarBody) -> None:
        """A car stands in the bay, wholly inside."""
        self.bays[node_id].crossing = False
        self.cars[car.name] = car
        self.where[car.name] = self.bays[node_id].station
        self._tell(WorldChange.CAR, node_id)

    def stands_in(self, place: Station, car: CarBody) -> None:
        """A car stands in a place from the beginning; nobody is told."""
        self.cars[car.name] = car
        self.where[car.name] = place

    def car_leaves(self, node_id: int, car: CarBody) -> None:
        """A car has left the compartment for the street."""
        self.bays[node_id].crossing = False
        self.where[car.name] = None
        self._tell(WorldChange.CAR, node_id)

    def hazard(self, rule: PlantRule, text: str) -> None:
        """A device was given an order that only its interlock kept from breaking a rule."""
        for tell in self.on_hazard:
            tell(rule, text)

    def _tell(self, change: WorldChange, node_id: int) -> None:
        now_us = self.timers.now_us()
        for watcher in self._watchers:
            watcher(change, node_id, now_us)
