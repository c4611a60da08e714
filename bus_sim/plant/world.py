"""Ground truth: where every body and car is, how doors stand, who is inside.

Devices and people change the world through the methods below; each change is told to all watchers, in the order in
which they came. The world permits everything that its bookkeeping can express, hazards included: interlocks belong
to the devices, and judging belongs to the oracle, so that a device without its interlock is found out.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum

from bus_sim.plant.bodies import Aboard, CarBody, Location
from bus_sim.plant.motion import Motion, standing
from bus_sim.plant.timers import Timers
from onboard.core.codes import DoorName, DoorPosition, KindCode, Side
from onboard.core.site import Segment, Site, Station

#: Tolerance of the fine position sensor opposite a station, mm (row P34).
MARK_TOLERANCE_MM = 5.0


class Change(Enum):
    """What kind of thing changed."""

    CARRIER = "carrier"
    SHUTTLE = "shuttle"
    DOOR = "door"
    PERSON = "person"
    CAR = "car"
    PLATFORM = "platform"


#: Called after a change with its kind, the node-ID of the machine it happened at, and the time in us.
Watcher = Callable[[Change, int, int], None]


@dataclass
class RobotBody:
    """A robot as it is: its carrier on a track and its shuttle's extension (mm from home, towards ``side``)."""

    track: int
    motion: Motion
    extension: Motion
    side: Side = Side.NEAR

    def is_out(self, now_us: int) -> bool:
        """Whether any part of the shuttle is outside the carrier, or about to be."""
        return now_us < self.extension.end_us or self.extension.final_mm > 0


@dataclass
class PlatformBody:
    """A lift's platform as it is: its motion along the shaft of ``track``, and the robot that stands on it."""

    track: int
    motion: Motion
    robot: int | None = None


@dataclass
class BayBody:
    """A compartment as it is. ``persons`` counts people inside; ``crossing`` a car with its body over the sill."""

    station: Station
    doors: dict[DoorName, DoorPosition] = field(
        default_factory=lambda: {DoorName.INPUT: DoorPosition.LOCKED, DoorName.OUTPUT: DoorPosition.LOCKED}
    )
    persons: int = 0
    crossing: bool = False


class World:
    """The site's bodies, cars, doors and people. Robots start standing at home, compartments empty and locked."""

    def __init__(self, site: Site, timers: Timers) -> None:
        self.site = site
        self.timers = timers
        self.robots: dict[int, RobotBody] = {}
        self.bays: dict[int, BayBody] = {}
        self.platforms: dict[int, PlatformBody] = {}
        self.cars: dict[str, CarBody] = {}
        self.where: dict[str, Location] = {}
        self._watchers: list[Watcher] = []
        now_us = timers.now_us()
        for machine in site.machines.values():
            if machine.kind is KindCode.ROBOT:
                home = standing(float(site.position_mm(machine.home)), now_us)
                self.robots[machine.node_id] = RobotBody(machine.home.track, home, standing(0.0, now_us))
            elif machine.kind is KindCode.LIFT:
                start = standing(float(site.position_mm(machine.home)), now_us)
                self.platforms[machine.node_id] = PlatformBody(machine.home.track, start)
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

    def at_mark(self, node_id: int) -> bool:
        """The fine sensor: whether a carrier's centre is opposite that of a segment, moving or not (row P34)."""
        robot = self.robots[node_id]
        pitch_mm = self.site.tracks[robot.track].pitch_mm
        position_mm = robot.motion.at(self.timers.now_us())[0]
        return abs(position_mm - round(position_mm / pitch_mm) * pitch_mm) <= MARK_TOLERANCE_MM

    def standing_position(self, node_id: int) -> Segment | None:
        """The mark at which a robot's carrier stands still; on a platform index 0 or length + 1 of the alley."""
        robot = self.robots[node_id]
        now_us = self.timers.now_us()
        position_mm, speed = robot.motion.at(now_us)
        if speed or now_us < robot.motion.end_us or robot.track not in self.site.tracks:
            return None
        track = self.site.tracks[robot.track]
        index = round(position_mm / track.pitch_mm) + 1
        off_mm = abs(position_mm - (index - 1) * track.pitch_mm)
        if off_mm > MARK_TOLERANCE_MM or not 0 <= index <= track.length + 1:
            return None
        return Segment(robot.track, index)

    def standing_segment(self, node_id: int) -> Segment | None:
        """The segment at whose centre a robot's carrier stands still, within the fine sensor's tolerance."""
        position = self.standing_position(node_id)
        if position is None or not 1 <= position.index <= self.site.tracks[position.track].length:
            return None
        return position

    # --- lifts -------------------------------------------------------------------------------------------------

    def platform_floor(self, node_id: int) -> int | None:
        """The floor at whose mark a lift's platform stands still, None while it is between floors."""
        platform = self.platforms[node_id]
        now_us = self.timers.now_us()
        position_mm, speed = platform.motion.at(now_us)
        if speed or now_us < platform.motion.end_us:
            return None
        track = self.site.tracks[platform.track]
        index = round(position_mm / track.pitch_mm) + 1
        if abs(position_mm - (index - 1) * track.pitch_mm) > MARK_TOLERANCE_MM:
            return None
        return track.joins[index - 1].track

    def end_mm(self, node_id: int, floor: int) -> float | None:
        """Centre of a lift's platform on the axis of a floor's alley, None where it does not stop there."""
        for sill in self.site.tracks[self.platforms[node_id].track].joins:
            if sill.track == floor:
                track = self.site.tracks[floor]
                return float(-track.pitch_mm if sill.index == 1 else track.length * track.pitch_mm)
        return None

    def limits_mm(self, floor: int) -> tuple[float, float]:
        """How far a carrier may drive on an alley now: onto a platform only where one stands there."""
        track = self.site.tracks[floor]
        low_mm, high_mm = 0.0, float((track.length - 1) * track.pitch_mm)
        for node_id in self.platforms:
            end_mm = self.end_mm(node_id, floor)
            if end_mm is not None and self.platform_floor(node_id) == floor:
                low_mm, high_mm = min(low_mm, end_mm), max(high_mm, end_mm)
        return low_mm, high_mm

    def aboard(self, node_id: int) -> int | None:
        """The robot that stands wholly on a lift's platform."""
        riding = self.platforms[node_id].robot
        if riding is not None:
            return riding
        floor = self.platform_floor(node_id)
        if floor is None:
            return None
        end_mm = self.end_mm(node_id, floor)
        for robot_id, robot in self.robots.items():
            position = self.standing_position(robot_id)
            stands = robot.track == floor and position is not None and end_mm is not None
            if stands and abs(robot.motion.at(self.timers.now_us())[0] - (end_mm or 0.0)) <= MARK_TOLERANCE_MM:
                return robot_id
        return None

    def overhang(self, node_id: int) -> int | None:
        """The robot whose body is over the sill of a lift at the floor where its platform is."""
        floor = self.platform_floor(node_id)
        return self.over_sill(node_id, floor) if floor is not None else None

    def over_sill(self, node_id: int, floor: int) -> int | None:
        """The robot whose body is over the sill of a lift at a floor, wherever the platform is."""
        end_mm = self.end_mm(node_id, floor)
        if end_mm is None:
            return None
        pitch_mm, half_mm = self.site.tracks[floor].pitch_mm, self.site.carrier_length_mm / 2
        edge_mm = -pitch_mm / 2 if end_mm < 0 else end_mm - pitch_mm / 2
        for robot_id, robot in self.robots.items():
            if robot.track == floor:
                position_mm = robot.motion.at(self.timers.now_us())[0]
                if position_mm - half_mm < edge_mm < position_mm + half_mm:
                    return robot_id
        return None

    def is_riding(self, robot_id: int) -> bool:
        """Whether the platform under a carrier is on its way."""
        return any(platform.robot == robot_id for platform in self.platforms.values())

    def move_platform(self, node_id: int, motion: Motion) -> None:
        """A platform's motion from now on; whoever stands on it rides, and is on another alley when it stands again."""
        platform = self.platforms[node_id]
        robot_id = self.aboard(node_id)
        platform.motion = motion
        now_us = self.timers.now_us()
        moving = now_us < motion.end_us
        if robot_id is not None:
            robot = self.robots[robot_id]
            platform.robot = robot_id if moving else None
            floor = None if moving else self.platform_floor(node_id)
            robot.track = platform.track if floor is None else floor
            if not moving and floor is None:
                platform.robot = robot_id
            self._tell(Change.CARRIER, robot_id)
        self._tell(Change.PLATFORM, node_id)

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

    def carrier_in_front(self, station: Station) -> bool:
        """Whether a carrier stands opposite a station."""
        return any(self.standing_segment(node_id) == station.segment for node_id in self.robots)

    # --- what changes ------------------------------------------------------------------------------------------

    def move_carrier(self, node_id: int, motion: Motion) -> None:
        """A carrier's motion from now on; also called with the same motion when it has come to its end."""
        self.robots[node_id].motion = motion
        self._tell(Change.CARRIER, node_id)

    def move_shuttle(self, node_id: int, extension: Motion, side: Side) -> None:
        """A shuttle's extension from now on."""
        self.robots[node_id].extension = extension
        self.robots[node_id].side = side
        self._tell(Change.SHUTTLE, node_id)

    def grip(self, node_id: int, station: Station) -> CarBody | None:
        """A shuttle lifts the car at a station; None where there is none."""
        cars = self.cars_at(station)
        if not cars:
            return None
        self.where[cars[0].name] = Aboard(node_id)
        self._tell(Change.CAR, node_id)
        return cars[0]

    def put_down(self, node_id: int, station: Station) -> CarBody | None:
        """A shuttle puts its car down at a station; None where it carries none."""
        car = self.car_aboard(node_id)
        if car is None:
            return None
        self.where[car.name] = station
        self._tell(Change.CAR, node_id)
        return car

    def set_door(self, node_id: int, door: DoorName, position: DoorPosition) -> None:
        """A compartment's door is in another position."""
        self.bays[node_id].doors[door] = position
        self._tell(Change.DOOR, node_id)

    def person_enters(self, node_id: int) -> None:
        """A person crosses the sill of a compartment inwards."""
        self.bays[node_id].persons += 1
        self._tell(Change.PERSON, node_id)

    def person_leaves(self, node_id: int) -> None:
        """A person crosses the sill outwards. Raises ``ValueError`` where nobody is inside."""
        if self.bays[node_id].persons == 0:
            raise ValueError(f"nobody is inside compartment {node_id}")
        self.bays[node_id].persons -= 1
        self._tell(Change.PERSON, node_id)

    def begin_crossing(self, node_id: int) -> None:
        """A car begins to roll over the sill of a compartment, in or out."""
        self.bays[node_id].crossing = True
        self._tell(Change.CAR, node_id)

    def car_enters(self, node_id: int, car: CarBody) -> None:
        """A car stands in the bay, wholly inside."""
        self.bays[node_id].crossing = False
        self.cars[car.name] = car
        self.where[car.name] = self.bays[node_id].station
        self._tell(Change.CAR, node_id)

    def car_leaves(self, node_id: int, car: CarBody) -> None:
        """A car has left the compartment for the street."""
        self.bays[node_id].crossing = False
        self.where[car.name] = None
        self._tell(Change.CAR, node_id)

    def _tell(self, change: Change, node_id: int) -> None:
        now_us = self.timers.now_us()
        for watcher in self._watchers:
            watcher(change, node_id, now_us)
