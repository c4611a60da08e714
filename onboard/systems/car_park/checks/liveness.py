"""Life: something happens while there is work, and nobody waits for ever (issue 3, point 3; issue 4, point 1)."""

from collections.abc import Callable
from math import sqrt

from onboard.contract.codes import CallResult, KindCode, Operation, TaskPhase
from onboard.contract.messages import Award, CallForProposals, CarAt, Message, Progress, Reference, TaskReport, Waiting
from onboard.core.site import Site
from onboard.systems.car_park.site import car_park
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers, Rule
from onboard.ways.site import Axis

#: Something happens within this, beyond the longest single motion, while there is an open task, us (issue 4, point 1).
IDLE_WITHIN_US = 60_000_000
#: A task is awarded at most so often to one machine, and to all, before its car is taken. Restarts, traffic and a
#: machine that fails make some; who is left out comes back after minutes.
MOST_SAME, MOST_ROUNDS = 3, 8


def run_us(length_mm: float, axis: Axis) -> int:
    """Rest-to-rest time of a run with trapezoidal or triangular speed."""
    ramp_mm = axis.speed_mm_s**2 / axis.acceleration_mm_s2
    if length_mm < ramp_mm:
        return round(2e6 * sqrt(length_mm / axis.acceleration_mm_s2))
    return round(1e6 * (length_mm / axis.speed_mm_s + axis.speed_mm_s / axis.acceleration_mm_s2))


def longest_motion_us(site: Site) -> int:
    """The longest that nobody has anything to tell: a whole alley or shaft, a turn, or a bay between two cars.

    There one door closes and the other opens, and a shuttle reaches in and grips.
    """
    park = car_park(site)
    bay_us = 2 * park.timing.door_us + run_us(park.shuttle_reach_mm, park.shuttle) + park.timing.grip_us
    times = [bay_us, park.carrier_turn_us]
    for track in park.tracks.values():
        axis = park.lift if track.number in park.lifts else park.carrier
        times.append(run_us((track.length + 1) * track.pitch_mm, axis))
    return max(times)


def longest_task_us(site: Site) -> int:
    """What one machine may need for one task and the way to a refuge with nobody in its way.

    Six runs and four rides (to the car, to its place, to a refuge), four doors and two handlings.
    """
    park = car_park(site)
    handling_us = 2 * run_us(park.shuttle_reach_mm, park.shuttle) + park.timing.grip_us
    return 10 * longest_motion_us(site) + 4 * park.timing.door_us + 2 * handling_us


def patience_us(site: Site) -> int:
    """How long a machine may wait at most: until each other robot has done a task, and one more for good measure."""
    robots = sum(machine.kind is KindCode.ROBOT for machine in site.machines.values())
    return max(2, robots) * longest_task_us(site)


class _OpenTasks(Rule):
    """Keeps the tasks that are open."""

    needs_site = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self.open: dict[Reference, int] = {}

    def handlers(self) -> Handlers:
        """Calls, awards and reports."""
        return {CallForProposals: self._on_call, TaskReport: self.on_report, Award: self.on_award}

    def _on_call(self, event: LogEvent[CallForProposals]) -> None:
        call = event.message
        if call.depth == 0 and call.operation in (Operation.PARK, Operation.RETRIEVE):
            self.open.setdefault(call.task, event.time_us)

    def on_report(self, event: LogEvent[TaskReport]) -> None:
        """Ends tasks."""
        if event.message.phase in (TaskPhase.DONE, TaskPhase.REFUSED):
            self.open.pop(event.message.task, None)

    def on_award(self, event: LogEvent[Award]) -> None:
        """Ends tasks that nobody wants any more."""
        if event.message.result is CallResult.WITHDRAWN and event.message.sender == event.message.task.origin:
            self.open.pop(event.message.task, None)


class SomethingHappens(_OpenTasks):
    """While a task is open, some machine or car moves, or a task goes on, within a minute beyond the longest motion."""

    name = "something-happens"
    liveness = True
    title = "progress within 60 s while there is work"
    source = "issue 4, point 1"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._last: LogEvent[Message] | None = None
        self._told = False
        self._award: tuple[int, int] | None = None
        self._limit_us = IDLE_WITHIN_US + longest_motion_us(picture.site)

    def handlers(self) -> Handlers:
        """Beside calls and reports, all that moves."""
        return {**super().handlers(), Progress: self._on_progress, CarAt: self._on_event}

    def _on_call(self, event: LogEvent[CallForProposals]) -> None:
        if not self.open:
            self._happened(event)
        super()._on_call(event)

    def _on_progress(self, event: LogEvent[Progress]) -> None:
        before = self.picture.bodies.get(event.message.sender)
        body = self.picture.body_told(event.message, event.time_us)
        if before is None or body is None or (body.place, body.speed_mm_s) != (before.place, before.speed_mm_s):
            self._happened(event)

    def _on_event(self, event: LogEvent[CarAt]) -> None:
        self._happened(event)

    def on_report(self, event: LogEvent[TaskReport]) -> None:
        """A report of a task counts as something that happens."""
        super().on_report(event)
        self._happened(event)

    def on_award(self, event: LogEvent[Award]) -> None:
        """A task finds its machine."""
        super().on_award(event)
        award = event.message
        if award.winner and award.result is CallResult.AWARDED and self._award != (award.sender, award.call):
            # Said again and again it moves nothing.
            self._award = (award.sender, award.call)
            self._happened(event)

    def _happened(self, event: LogEvent[Message]) -> None:
        self._last, self._told = event, False

    def tick(self, now_us: int) -> None:
        """Whether it stands still for too long."""
        if not self.open or self._told or self._last is None:
            return
        if self.picture.waited_us(self._last.time_us, now_us) <= self._limit_us:
            return
        self._told = True
        task = min(self.open, key=lambda one: (self.open[one], one))
        since_s = (now_us - self._last.time_us) // 1_000_000
        what = f"nothing happened for {since_s} s; {len(self.open)} open tasks, oldest {task.origin}.{task.number}"
        self.find(self._last, (task.origin,), what)


class NoRounds(_OpenTasks):
    """No task goes round: awarded, given back and awarded again, without a car that moves for it.

    What is awarded while faults last is not counted: a machine that was killed gives nothing back.
    """

    name = "no-rounds"
    liveness = True
    title = "no task awarded again and again"
    source = "issue 13, point 5"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._calls: dict[Reference, dict[int, set[int]]] = {}

    def on_award(self, event: LogEvent[Award]) -> None:
        """One more round, unless it is only said again."""
        super().on_award(event)
        award = event.message
        is_whole = award.task in self.open and award.sender == award.task.origin
        if award.result is not CallResult.AWARDED or not is_whole or event.time_us < self.picture.excused_us:
            return
        calls = self._calls.setdefault(award.task, {})
        if award.call in calls.setdefault(award.winner, set()):
            return
        calls[award.winner].add(award.call)
        total = sum(len(one) for one in calls.values())
        if len(calls[award.winner]) == MOST_SAME + 1 or total == MOST_ROUNDS + 1:
            what = f"task {award.task.origin}.{award.task.number} is awarded for the {total}th time"
            what += f", to {award.winner} for the {len(calls[award.winner])}th"
            self.find(event, (award.sender, award.winner), what)

    def on_report(self, event: LogEvent[TaskReport]) -> None:
        """A car that is loaded, or a task that is over, ends the rounds."""
        super().on_report(event)
        if event.message.phase is TaskPhase.LOADED or event.message.task not in self.open:
            self._calls.pop(event.message.task, None)


class NobodyStarves(Rule):
    """No machine waits longer than the others could need together: from ``Waiting`` to its next motion or work.

    ``longest_us`` is the longest wait of each machine, for the report.
    """

    name = "nobody-starves"
    liveness = True
    title = "a bounded wait for each machine"
    source = "issue 3, point 3; issue 4, point 1"
    needs_site = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self.limit_us = patience_us(picture.site)
        self._waiting: dict[int, LogEvent[Waiting]] = {}
        self._told: set[int] = set()

    def handlers(self) -> Handlers:
        """Waits, and what ends them."""
        return {Waiting: self._on_waiting, Progress: self._on_progress, TaskReport: self._on_report}

    def _on_waiting(self, event: LogEvent[Waiting]) -> None:
        self._waiting.setdefault(event.message.sender, event)

    def _on_progress(self, event: LogEvent[Progress]) -> None:
        before = self.picture.bodies.get(event.message.sender)
        body = self.picture.body_told(event.message, event.time_us)
        if before is None or body is None or body.place != before.place or body.speed_mm_s:
            self._ended(event.message.sender, event.time_us)

    def _on_report(self, event: LogEvent[TaskReport]) -> None:
        self._ended(event.message.sender, event.time_us)

    def _ended(self, node: int, now_us: int) -> None:
        waiting = self._waiting.pop(node, None)
        if waiting is not None:
            self._note(node, self.picture.waited_us(waiting.time_us, now_us))
            self._told.discard(node)

    def _note(self, node: int, waited_us: int) -> None:
        self.longest_us[node] = max(self.longest_us.get(node, 0), waited_us)

    def tick(self, now_us: int) -> None:
        """Who waits for too long."""
        for node, event in self._waiting.items():
            waited_us = self.picture.waited_us(event.time_us, now_us)
            self._note(node, waited_us)
            if waited_us > self.limit_us and node not in self._told:
                self._told.add(node)
                wait = event.message
                what = f"waits for {wait.blocker} at track {wait.track}, index {wait.index} for {waited_us // 10**6} s"
                self.find(event, (node, wait.blocker), what)

    def finish(self, now_us: int) -> None:
        """Count waits that last to the end."""
        self.tick(now_us)
