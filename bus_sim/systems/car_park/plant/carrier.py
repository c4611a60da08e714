"""The carrier's drive: moves along its track only while fresh orders arrive, and brakes by itself otherwise."""

from collections.abc import Callable

from bus_sim.devices.link import DeviceBusLink
from bus_sim.devices.timers import Timer, Timers
from bus_sim.systems.car_park.plant.motion import Motion, braking, driving, standing
from bus_sim.systems.car_park.plant.rules import PlantRule
from bus_sim.systems.car_park.plant.shaft import PlatformBody
from bus_sim.systems.car_park.plant.world import CarParkWorld, RobotBody, WorldChange
from onboard.contract.codes import DriveMode
from onboard.contract.messages import DriveOrder, DriveState, Message
from onboard.core.serial import is_newer
from onboard.core.site import Segment
from onboard.ways.site import Axis, Offset, WaySite

#: A moving drive that has heard no order for this long brakes to a stand (dbc/device.dbc).
DRIVE_TIMEOUT_US = 500_000
#: DriveState is repeated at least this often (dbc/device.dbc).
REPEAT_US = 10_000_000
#: A target nearer than this is where the carrier stands, mm.
AT_TARGET_MM = 0.5


class Carrier:
    """Drive, position sensor and mark sensor of one robot's carrier.

    ``shuttle_home`` is the home switch wired to the drive (row P32): while it is open the drive refuses to move, and
    brakes where it moves, in mode FAULT until the switch closes. So it does, until it takes up another order, for a
    target beyond the end of its alley unless a platform stands there, whose shaft gate is open only then; and aboard a
    platform that is not at a floor. ``fault`` says why in words.

    An order for another track, into it or out of it through a mouth, makes it turn first; it does so only standing in
    the mouth, and refuses elsewhere. On a straight site the order says only that it is the other way, and else where on
    the tape. Aboard a platform with two doors it goes by whichever the order names, without a turn. A turn that was
    begun is ended whatever is ordered meanwhile: the body does not leave its place. The order that is fresh then is
    carried out.

    An order is taken up if its sequence is the last one's or newer; any sequence counts after ``DRIVE_TIMEOUT_US``
    without orders, as that of a controller that started again. Repeating an order keeps it fresh. A DriveState follows
    on every change of mode, on passing the middle or the border of a segment, and slowly otherwise.
    """

    def __init__(
        self,
        node_id: int,
        site: WaySite,
        world: CarParkWorld,
        timers: Timers,
        link: DeviceBusLink,
        shuttle_home: Callable[[], bool],
    ) -> None:
        self.node_id = node_id
        self.fault = ""
        self.stale_orders = 0
        self._site = site
        self._world = world
        self._timers = timers
        self._link = link
        self._shuttle_home = shuttle_home
        self._order: DriveOrder | None = None
        self._is_braking = False
        self._fresh_until_us = 0
        self._watchdog: Timer | None = None
        self._timer: Timer | None = None
        self._moving = False
        self._turn_timer: Timer | None = None
        self._repeat_at_us = 0
        self._told_mm = 0
        link.subscribe(self._on_message)
        link.answer(lambda: self._say(timers.now_us()))
        world.watch(self._on_change)

    def start(self) -> None:
        """Power on: say where the carrier is, then again slowly."""
        self._say(self._timers.now_us())

    @property
    def mode(self) -> DriveMode:
        """What ``DriveState`` says of the drive at this moment."""
        if self.fault:
            return DriveMode.FAULT
        if self._turn_timer is not None:
            return DriveMode.TURNING
        if not self._moving:
            return DriveMode.STANDING
        return DriveMode.BRAKING if self._is_braking else DriveMode.MOVING

    def state(self, now_us: int) -> DriveState:
        """What the sensors say now."""
        position_mm, speed_mm_s = self._body.motion.at(now_us)
        at_mark = self._at_mark()
        sequence = self._order.sequence if self._order is not None else 0
        across = self._is_across
        tape_mm = round(position_mm) + self._origin_mm
        return DriveState(self.node_id, sequence, tape_mm, round(speed_mm_s), self.mode, at_mark, across)

    @property
    def _body(self) -> RobotBody | PlatformBody:
        return self._world.robots[self.node_id]

    @property
    def _is_across(self) -> bool:
        return self._site.across(self._world.axis_of(self.node_id))

    @property
    def _origin_mm(self) -> int:
        """Where the tape has index 1 of the track on whose axis the drive measures."""
        return self._site.tracks[self._world.axis_of(self.node_id)].origin_mm

    @property
    def _axis(self) -> Axis:
        return self._site.carrier

    @property
    def _pitch_mm(self) -> int:
        return self._site.tracks[self._world.axis_of(self.node_id)].pitch_mm

    def _move(self, motion: Motion) -> None:
        self._world.move_carrier(self.node_id, motion)

    def _at_mark(self) -> bool:
        return self._world.at_mark(self.node_id)

    # --- orders ------------------------------------------------------------------------------------------------

    def _on_message(self, message: Message, _: int) -> None:
        if isinstance(message, DriveOrder):
            self._on_order(message, self._timers.now_us())

    def _on_order(self, order: DriveOrder, now_us: int) -> None:
        if self._is_stale(order, now_us):
            self.stale_orders += 1
            return
        self._fresh_until_us = now_us + DRIVE_TIMEOUT_US
        is_repeat = order == self._order
        self._order = order
        if self._turn_timer is not None:
            return
        if not self._shuttle_home() and self._would_move(order, now_us):
            self._world.hazard(PlantRule.ORDER_TO_TEAR, f"robot {self.node_id}")
        refusal = self._refusal(order)
        if refusal:
            self._fail(refusal, now_us)
        elif not (is_repeat and self.mode is DriveMode.MOVING):
            self._carry_out(order, now_us)

    def _is_stale(self, order: DriveOrder, now_us: int) -> bool:
        if self._order is None or now_us >= self._fresh_until_us:
            return False
        return order.sequence != self._order.sequence and not is_newer(order.sequence, self._order.sequence, 8)

    def _would_move(self, order: DriveOrder, now_us: int) -> bool:
        aim = self._aim(order)
        if aim is None or aim.track != self._body.track:
            return True
        return abs(aim.position_mm - self._body.motion.at(now_us)[0]) > AT_TARGET_MM

    def _aim(self, order: DriveOrder) -> Offset | None:
        """Track and position on it of an order's target; None where it is on one to which no way leads from here."""
        here, ways = self._body.track, self._world.other_ways(self.node_id)
        if not self._site.is_charted:
            if order.across is self._is_across:
                return Offset(here, order.target_mm)
            return Offset(ways[0].track, order.target_mm) if ways else None
        told = self._site.on_tape(order.target_mm)
        if told is None:
            return Offset(here, order.target_mm - self._origin_mm)
        beside = (*ways, *self._world.other_doors(self.node_id))
        return told if told.track in (here, *(one.track for one in beside)) else None

    def _refusal(self, order: DriveOrder) -> str:
        if not self._shuttle_home():
            return "the shuttle is out"
        if self._world.is_riding(self.node_id):
            return "the platform under the carrier is between two floors"
        aim = self._aim(order)
        if aim is None:
            return "the carrier does not stand in the mouth of that track"
        low_mm, high_mm = self._world.limits_mm(aim.track)
        if not low_mm <= aim.position_mm <= high_mm:
            return f"target {order.target_mm} mm is beyond the end of the track, and no platform is there"
        return ""

    def _carry_out(self, order: DriveOrder, now_us: int) -> None:
        before = self.mode
        self.fault = ""
        aim = self._aim(order)
        assert aim is not None
        self._go_by_door(aim.track)
        position_mm, speed_mm_s = self._body.motion.at(now_us)
        axis = self._axis
        limit_mm_s = min(order.speed_limit_mm_s, axis.speed_mm_s)
        if limit_mm_s <= 0:
            self._brake(now_us)
        elif aim.track != self._body.track:
            self._turn(aim.track, now_us)
        elif speed_mm_s or abs(aim.position_mm - position_mm) > AT_TARGET_MM:
            motion = driving(position_mm, speed_mm_s, aim.position_mm, limit_mm_s, axis.acceleration_mm_s2, now_us)
            self._moving, self._is_braking = True, False
            self._move(motion)
            self._watch(now_us)
        if self.mode is not before:
            self._say(now_us)
        else:
            self._schedule(now_us)

    # --- turning -----------------------------------------------------------------------------------------------

    def _go_by_door(self, track: int) -> None:
        for position in self._world.other_doors(self.node_id):
            if position.track == track != self._body.track:
                self._world.go_by(self.node_id, position)

    def _turn(self, track: int, now_us: int) -> None:
        turned = next((one for one in self._world.other_ways(self.node_id) if one.track == track), None)
        if turned is None:
            return
        self._turn_timer = self._timers.call_at(now_us + self._site.carrier_turn_us, lambda: self._end_turn(turned))
        self._world.begin_turn(self.node_id, turned.track)

    def _end_turn(self, turned: Segment) -> None:
        now_us = self._timers.now_us()
        self._turn_timer = None
        self._world.end_turn(self.node_id, turned)
        order = self._order
        if order is not None and now_us < self._fresh_until_us:
            refusal = self._refusal(order)
            if refusal:
                self._fail(refusal, now_us)
                return
            # Standing, so that the word of it is told in any case.
            self._say(now_us)
            self._carry_out(order, now_us)
        else:
            self._say(now_us)

    # --- stopping ----------------------------------------------------------------------------------------------

    def _watch(self, now_us: int) -> None:
        """One timer at a time, moved on while orders keep coming."""
        if self._watchdog is None:
            self._watchdog = self._timers.call_at(max(now_us, self._fresh_until_us), self._on_watchdog)

    def _on_watchdog(self) -> None:
        self._watchdog = None
        now_us = self._timers.now_us()
        if not self._moving or self._is_braking:
            return
        if now_us < self._fresh_until_us:
            self._watch(now_us)
            return
        self._brake(now_us)
        self._say(now_us)

    def _brake(self, now_us: int) -> None:
        if not self._moving or self._is_braking:
            return
        position_mm, speed_mm_s = self._body.motion.at(now_us)
        self._is_braking = True
        motion = braking(position_mm, speed_mm_s, self._axis.acceleration_mm_s2, now_us)
        self._move(motion)

    def _fail(self, reason: str, now_us: int) -> None:
        if self.fault == reason:
            return
        self.fault = reason
        self._brake(now_us)
        self._say(now_us)

    def _on_change(self, change: WorldChange, node_id: int, now_us: int) -> None:
        if change is WorldChange.SHUTTLE and node_id == self.node_id:
            self._on_home_switch(now_us)
        elif change is WorldChange.PLATFORM:
            self._on_platform(now_us)

    def _on_platform(self, now_us: int) -> None:
        """A shaft's gate opened or shut, perhaps after a ride to an alley of another length."""
        if not self._moving:
            if round(self._body.motion.final_mm) + self._origin_mm != self._told_mm:
                self._say(now_us)
        elif self._order is not None:
            refusal = self._refusal(self._order)
            if refusal:
                self._fail(refusal, now_us)

    def _on_home_switch(self, now_us: int) -> None:
        """Opening stops a moving drive, closing ends the fault that it caused."""
        if not self._shuttle_home():
            if self._moving:
                self._fail("the shuttle is out", now_us)
        elif self.fault:
            self.fault = ""
            self._say(now_us)

    # --- what is said ------------------------------------------------------------------------------------------

    def _on_timer(self) -> None:
        self._timer = None
        now_us = self._timers.now_us()
        motion = self._body.motion
        if self._moving and now_us >= motion.end_us:
            self._moving = self._is_braking = False
            self._move(standing(motion.final_mm, now_us))
        self._say(now_us)

    def _say(self, now_us: int) -> None:
        state = self.state(now_us)
        self._told_mm = state.position_mm
        self._link.send(state)
        self._repeat_at_us = now_us + REPEAT_US
        self._schedule(now_us)

    def _schedule(self, now_us: int) -> None:
        """Set the timer for the next thing to be seen: a middle or border, the end of the motion, the slow repeat."""
        if self._timer is not None:
            self._timer.cancel()
        when_us = self._repeat_at_us
        if self._moving:
            when_us = min(when_us, self._body.motion.end_us, self._next_mark_us(now_us))
        self._timer = self._timers.call_at(when_us, self._on_timer)

    def _next_mark_us(self, now_us: int) -> int:
        motion = self._body.motion
        step_mm = self._pitch_mm / 2
        nearest = round(motion.at(now_us)[0] / step_mm)
        reached = [motion.next_reach_us(mark * step_mm, now_us) for mark in (nearest - 1, nearest, nearest + 1)]
        return min((time for time in reached if time is not None), default=motion.end_us)
