"""What robots and lifts do with their time, and how far they travel: told from their own messages on the fleet bus.

Robots tell their place, their car and their plan; lifts tell their place only, and who is aboard follows from where the
robots say they are.
"""

from collections import Counter
from dataclasses import dataclass, field
from enum import StrEnum

from onboard.contract.codes import CallResult, KindCode, LegAction, Operation, TaskPhase
from onboard.contract.messages import Itinerary, Reference, TaskReport
from onboard.core.site import Segment, Site
from onboard.history.calls import CallAnswered, CallHistory
from onboard.history.history import Fact, History
from onboard.history.lives import WaitTold
from onboard.history.places import PlaceTold
from onboard.history.plans import PlanTold
from onboard.history.tasks import TaskTold
from onboard.ways.site import way_site

#: Operations whose winner has a task until it reports the end.
TASKS = (Operation.PARK, Operation.RETRIEVE)


class Activity(StrEnum):
    """Where a machine's time goes; at any moment exactly one.

    A robot rides while it stands on a platform, whether the lift moves or not; it handles while it stands where its
    plan has the next car taken or left, the wait for a door included. A lift rides with a robot aboard, drives without
    one, handles while a robot is aboard and it stands, and has a task as long as a robot's plan holds a ride on it.
    """

    RIDING = "riding"
    DRIVING = "driving"
    HANDLING = "handling"
    STANDING = "standing"
    IDLE = "idle"


@dataclass
class MachineActivity:
    """One robot or lift as its messages tell it; times in us of the log, since the last ``begin``."""

    node: int
    kind: KindCode
    at: Segment
    position_mm: int
    since_us: int = 0
    activity: Activity = Activity.IDLE
    #: Before its first word a machine is taken to be at home; getting there is no travel.
    heard: bool = False
    moving: bool = False
    works: list[Segment] = field(default_factory=list)
    tasks: set[Reference] = field(default_factory=set)
    rides: Counter[int] = field(default_factory=Counter)
    busy: bool = False
    waiting_since_us: int | None = None
    spent_us: Counter[Activity] = field(default_factory=Counter)
    busy_us: int = 0
    travel_mm: int = 0
    empty_mm: int = 0
    #: Of that on ways that it took of its own accord: its plan has no work, and its stamp is its own.
    resting_mm: int = 0
    is_resting: bool = False
    longest_wait_us: int = 0


class Activities:
    """Give it what a history was told by every message of the fleet bus, in the order of the log."""

    def __init__(self, site: Site, history: History, begin_us: int = 0) -> None:
        ways = way_site(site)
        self.bodies: dict[int, MachineActivity] = {}
        self._site = site
        self._loads = history.loads
        self._begin_us = begin_us
        for machine in site.machines.values():
            if machine.kind in (KindCode.ROBOT, KindCode.LIFT):
                track = next((t for t in ways.lifts if site.stewards[t] == machine.node_id), machine.home.track)
                at = machine.home if machine.kind is KindCode.ROBOT else Segment(track, machine.home.index)
                self.bodies[machine.node_id] = MachineActivity(
                    machine.node_id, machine.kind, at, ways.position_mm(at), since_us=begin_us
                )

    def begin(self, time_us: int) -> None:
        """Measure from now on; what everybody is doing is kept."""
        self._begin_us = time_us
        for body in self.bodies.values():
            body.since_us = time_us
            body.spent_us = Counter()
            body.busy_us = body.travel_mm = body.empty_mm = body.resting_mm = body.longest_wait_us = 0

    def take(self, fact: Fact | None, time_us: int) -> None:
        """Take up what one message has told."""
        match fact:
            case CallAnswered() if fact.call is not None and fact.is_end:
                self._on_end(fact.call, fact, time_us)
            case PlaceTold():
                self._on_place(fact, time_us)
            case WaitTold():
                self._on_waiting(fact, time_us)
            case TaskTold():
                self._on_report(fact.report, time_us)
            case PlanTold() if fact.is_firm and fact.plan.sender in self.bodies:
                self._on_itinerary(self.bodies[fact.plan.sender], fact.plan, time_us)

    def settle_all(self, time_us: int) -> None:
        """Bring all times up to ``time_us``."""
        for body in self.bodies.values():
            self._settle(body, time_us)
            if body.waiting_since_us is not None:
                self._note_wait(body, time_us)

    # --- messages ----------------------------------------------------------------------------------------------

    def _on_place(self, told: PlaceTold, time_us: int) -> None:
        body, place = self.bodies.get(told.node), told.place
        if body is None or place.segment.track not in way_site(self._site).tracks:
            return
        position_mm = way_site(self._site).position_mm(place.segment) + place.offset_mm
        left = self._platform_of(body)
        if body.heard and place.segment.track == body.at.track:
            self._travel(body, abs(position_mm - body.position_mm))
        moved = place.segment != body.at or place.speed_mm_s != 0
        body.heard = True
        body.at, body.position_mm, body.moving = place.segment, position_mm, place.speed_mm_s != 0
        if moved and body.waiting_since_us is not None:
            self._note_wait(body, time_us)
            body.waiting_since_us = None
        if left is not None and self._platform_of(body) is None:
            self._end_ride(left, body, time_us)
        self._settle(body, time_us)
        if body.kind is KindCode.LIFT or left != self._platform_of(body):
            self._settle_lifts(time_us)

    def _travel(self, body: MachineActivity, way_mm: int) -> None:
        body.travel_mm += way_mm
        loaded = body.node in self._loads.aboard if body.kind is KindCode.ROBOT else self._passengers(body)
        if not loaded:
            body.empty_mm += way_mm
            body.resting_mm += way_mm if body.is_resting else 0

    def _on_waiting(self, told: WaitTold, time_us: int) -> None:
        body = self.bodies.get(told.word.sender)
        if body is not None and body.waiting_since_us is None:
            body.waiting_since_us = time_us

    def _on_itinerary(self, robot: MachineActivity, itinerary: Itinerary, time_us: int) -> None:
        robot.works = [Segment(leg.track, leg.to_index) for leg in itinerary.legs if leg.action is LegAction.WORK]
        robot.is_resting = not robot.works and itinerary.stamp.initiator == robot.node
        self._settle(robot, time_us)
        rides = Counter(self._site.stewards.get(leg.track) for leg in itinerary.legs if leg.action is LegAction.RIDE)
        for lift in self.bodies.values():
            if lift.kind is KindCode.LIFT:
                lift.rides[robot.node] = rides[lift.node]
                self._settle(lift, time_us)

    def _on_end(self, call: CallHistory, end: CallAnswered, time_us: int) -> None:
        body = self.bodies.get(end.award.winner)
        if call.terms.operation in TASKS and body is not None and end.award.result is CallResult.AWARDED:
            body.tasks.add(call.terms.task)
            self._settle(body, time_us)

    def _on_report(self, report: TaskReport, time_us: int) -> None:
        body = self.bodies.get(report.sender)
        if body is None:
            return
        if report.phase in (TaskPhase.LOADED, TaskPhase.DONE):
            body.works = body.works[1:]
        if report.phase in (TaskPhase.DONE, TaskPhase.FORFEITED):
            body.tasks.discard(report.task)
        self._settle(body, time_us)

    def _end_ride(self, lift: int, robot: MachineActivity, time_us: int) -> None:
        body = self.bodies.get(self._site.stewards[lift])
        if body is not None and body.rides[robot.node] > 0:
            body.rides[robot.node] -= 1
            self._settle(body, time_us)

    # --- time --------------------------------------------------------------------------------------------------

    def _platform_of(self, body: MachineActivity) -> int | None:
        return way_site(self._site).platforms.get(body.at) if body.kind is KindCode.ROBOT else None

    def _passengers(self, lift: MachineActivity) -> bool:
        return any(self._platform_of(body) == lift.at.track for body in self.bodies.values())

    def _settle_lifts(self, time_us: int) -> None:
        for body in self.bodies.values():
            if body.kind is KindCode.LIFT:
                self._settle(body, time_us)

    def _settle(self, body: MachineActivity, time_us: int) -> None:
        """Book the time since the last change to what the machine did then."""
        passed_us = max(0, time_us - body.since_us)
        body.spent_us[body.activity] += passed_us
        if body.busy:
            body.busy_us += passed_us
        body.since_us = max(time_us, body.since_us)
        body.busy = bool(body.tasks) or any(body.rides.values())
        body.activity = self._activity(body)

    def _activity(self, body: MachineActivity) -> Activity:
        if body.kind is KindCode.LIFT:
            if self._passengers(body):
                return Activity.RIDING if body.moving else Activity.HANDLING
        elif self._platform_of(body) is not None and not body.moving:
            return Activity.RIDING
        elif body.works and body.works[0] == body.at and not body.moving:
            return Activity.HANDLING
        if body.moving:
            return Activity.DRIVING
        return Activity.STANDING if body.busy else Activity.IDLE

    def _note_wait(self, body: MachineActivity, time_us: int) -> None:
        assert body.waiting_since_us is not None
        since_us = max(body.waiting_since_us, self._begin_us)
        body.longest_wait_us = max(body.longest_wait_us, time_us - since_us)
