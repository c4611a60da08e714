"""What a compartment has called for: the task that has its bay, and the next one while the bay still works.

The next one is a car that is to be fetched. It is called for with the time from which the bay can take the car, so that
its robot is on its way, or there, when the bay is empty; what it is and who won it is journalled like the other.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from onboard.contract.codes import KindCode, LegAction, Operation, Reason, TaskPhase, TokenKind
from onboard.contract.constants import ANY_STATION, NOBODY, TASK_VERSION_BITS
from onboard.contract.messages import (
    CallForProposals,
    Leg,
    Reference,
    SyncRequest,
    TaskReport,
    TokenRefusal,
    TokenRequest,
)
from onboard.core.authority import segment_token
from onboard.core.effects import Effect, Report, Send
from onboard.core.negotiation import EVENT_TYPES
from onboard.core.serial import from_bus_ms, successor
from onboard.core.site import Segment, Station
from onboard.systems.car_park import bay_task, custody
from onboard.systems.car_park.bay_memory import (
    BayMemory,
    ahead_over_record,
    ahead_record,
    job_over_record,
    job_record,
    ticket_record,
)
from onboard.systems.car_park.bay_task import REMINDERS, RETRY_US, SETTLING_US, BayPhase, BayTask
from onboard.systems.car_park.in_vain import InVain
from onboard.systems.car_park.site import open_end
from onboard.systems.car_park.stewardship import Stewardship
from onboard.systems.car_park.unsaid import UnsaidParkings
from onboard.ways.mirror import WayFleet
from onboard.ways.tokens import car_token
from onboard.ways.told_way import has_work

#: A winner of whose task nothing shows is told after this that it has it, and again, us: a plan is told within a second
#: of its award, and who finds no way for longer than this is asked once, or gives the task back.
ASK_AGAIN_US = 10_000_000
#: A winner whose plan has no work at all, and whose car is another's, has lost the task after this, us: one that finds
#: no way gives it back sooner (``going_around.KEEP_US``), and one that has not heard of it has been told meanwhile.
NOTHING_SHOWN_US = 13_000_000


@dataclass
class BayCalls:
    """``job`` has the bay, ``ahead`` gets it next. ``on_won`` is told of each task that was won."""

    fleet: WayFleet
    station: Station
    stewardship: Stewardship
    memory: BayMemory
    floor: Callable[[CallForProposals, int], int]
    on_won: Callable[[BayTask], None]
    job: BayTask | None = None
    ahead: BayTask | None = None
    #: Who has asked for the bay just now though another is to come.
    asks_too: int = NOBODY
    #: A car that is moved while nobody waits (``quiet_moves.py``): it needs no bay, and is never called anew.
    move: BayTask | None = None
    #: Whether rights were made anew and customers are to hear that no ticket is known any more; None: they never were.
    forgot: bool | None = None
    in_vain: InVain = field(default_factory=InVain)
    unsaid: UnsaidParkings = field(init=False)

    def __post_init__(self) -> None:
        self.unsaid = UnsaidParkings(self.fleet)

    def in_hand(self) -> list[BayTask]:
        """Both, as far as there are any."""
        return [task for task in (self.job, self.ahead) if task is not None]

    @property
    def has_any(self) -> bool:
        """Whether there is a task, in hand or to be called for once more."""
        return bool(self.in_hand()) or self.in_vain.is_any

    @property
    def _is_next_here(self) -> bool:
        """Whether the car of the next task is in the bay: by a right that was given for another one."""
        return self.ahead is not None and self.ahead.is_brought(self.fleet.mirror, self.fleet.node_id, self.station)

    def named(self, reference: Reference) -> BayTask | None:
        """The task of this name, where it is in hand."""
        return next((task for task in self.in_hand() if task.task == reference), None)

    def of_car(self, car: Reference) -> BayTask | None:
        """The task that is about a car."""
        return next((task for task in self.in_hand() if task.car == car), None)

    def take_up(self) -> None:
        """After a restart: the next task as the journal knows it; whoever has won it says so when asked."""
        if self.memory.ahead is not None:
            task, car, wheelbase_mm = self.memory.ahead
            winner, version = self.stewardship.winner_of(car, task)
            self.ahead = BayTask(task, Operation.RETRIEVE, car, wheelbase_mm, winner, version)

    # --- what is heard -----------------------------------------------------------------------------------------

    def on_request(self, request: TokenRequest | SyncRequest, now_us: int) -> list[Effect]:
        """Who asks for the car of a task hears whose that is, where it may not know; a robot that is back is called.

        Who asks what others know has just come, or was without bus time: of no bid before does it tell anything.
        """
        if isinstance(request, SyncRequest):
            machine = self.fleet.site.machines.get(request.sender)
            if machine is not None and machine.kind is KindCode.ROBOT:
                self._may_be_served(now_us)
            return []
        if request.token_kind is not TokenKind.CAR:
            return []
        found = (task for task in self.in_hand() if request.token == car_token(*task.car).number)
        return [effect for task in found for effect in task.remind(self.fleet.node_id, request.sender)]

    def _may_be_served(self, now_us: int) -> None:
        self.in_vain.may_be_served(now_us)
        for task in self.in_hand():
            task.may_be_served(now_us)

    def refused_to_winner(self, refusal: TokenRefusal, now_us: int) -> list[Effect] | None:
        """The car's custodian knows of no winner; None where the word is about nothing of mine."""
        found = next((one for one in self.in_hand() if one.is_unknown_to(refusal, self.fleet.mirror)), None)
        if found is None:
            return None
        found.reminders += 1
        # Whoever has not heard the call does not know by the award which car it is about.
        return (
            [Send(found.award(self.fleet.node_id))] if found.reminders < REMINDERS else self.call_again(found, now_us)
        )

    def on_report(self, report: TaskReport, now_us: int, *, is_starting: bool) -> list[Effect]:
        """What its winner, or who has won it once, says of a task of mine; or the custodian of its car.

        ``is_starting``: doors and bay are not known yet, and of the task in hand only the journal tells.
        """
        self.unsaid.hear(report)
        task, machine = self.named(report.task), self.fleet.site.machines.get(report.sender)
        tokens, name = self.fleet.tokens, report.task
        if not (tokens.is_synced or self.fleet.has_no_rights) and self.memory.never_gave(name, self.fleet.node_id):
            tokens.contradicted = report.sender, f"has task {name.number} of this node, which it never gave"
        if task is not None and report.phase is TaskPhase.FORFEITED:
            return self._on_forfeit(task, report.sender, now_us)
        is_robot = machine is not None and machine.kind is KindCode.ROBOT
        if is_robot and self.job is None and self.stewardship.claims_bay(report, self.memory):
            return []
        if is_starting and task is None:
            return self.stewardship.claimed(report, self.memory) if is_robot else []
        if not is_robot:
            return []
        if report.phase is TaskPhase.DONE:
            # Its plan has room again.
            self._may_be_served(now_us)
        return self._of_robot(report, task, now_us)

    def _of_robot(self, report: TaskReport, task: BayTask | None, now_us: int) -> list[Effect]:
        if task is None:
            is_moved = self.move is not None and self.move.task == report.task
            return [] if is_moved else bay_task.withdrawal(self.fleet.node_id, report)
        if report.phase is TaskPhase.DONE and task.operation is Operation.RETRIEVE and report.sender == task.winner:
            return self._fetch_anew(task, now_us) if report.station != self.station.number else []
        if report.phase is TaskPhase.AWARDED and not task.winner and task.retry_at_us is not None and not task.call:
            return self.won_by(task, report.sender, task.call)
        return task.remind(self.fleet.node_id, report.sender)

    def _fetch_anew(self, task: BayTask, now_us: int) -> list[Effect]:
        """The winner could not wait before the bay, and left the car at a place: that task is done, here is another."""
        name, number = self.memory.next_reference(self.fleet)
        anew = BayTask(
            name, Operation.RETRIEVE, task.car, task.wheelbase_mm, ready_us=self.done_at_us(self.job, now_us) or 0
        )
        over: list[Effect] = [number]
        if task is self.job:
            self.job = anew
            over.append(job_record(name, Operation.RETRIEVE, task.car, task.wheelbase_mm))
        else:
            self.ahead = anew
            over += [ahead_over_record(task.task), ahead_record(name, task.car, task.wheelbase_mm)]
            if self._is_full:
                # It would be carried before a full bay, and back, time after time.
                anew.retry_at_us = now_us
                return over
        return over + self.call_for(anew, now_us)

    def _on_forfeit(self, task: BayTask, sender: int, now_us: int) -> list[Effect]:
        """The winner gives the task back, or the custodian of the car has taken the right to it back."""
        record = self.fleet.mirror.cars.get(task.car)
        if task.winner and sender == task.winner:
            return self.call_again(task, now_us)
        if record is None or sender != record.custodian:
            return []
        if not task.winner:
            return self.call_again(task, now_us) if self._is_silent(task, now_us) else []
        heard = task.winner not in self.fleet.mirror.obstacles.machines
        if heard and task.version != 1 and task.reminders < REMINDERS:
            # It has not heard of the newest award yet.
            task.reminders += 1
            return [Send(task.award(self.fleet.node_id))]
        return self.call_again(task, now_us)

    def _is_unheard(self, task: BayTask, now_us: int) -> bool:
        # A car that is still to drive in is nobody's yet.
        return (task.is_coming or custody.is_mine(self.fleet, task.car)) and self._is_silent(task, now_us)

    def _is_silent(self, task: BayTask, now_us: int) -> bool:
        """Whether its winner has not said for long that it has it."""
        return self.fleet.negotiation.silent_winner(task.task, now_us) != NOBODY

    # --- calls -------------------------------------------------------------------------------------------------

    def won_by(self, task: BayTask, winner: int, call: int) -> list[Effect]:
        """``winner`` has won a task of mine in ``call``, 0 where that is not known."""
        task.winner, task.call, task.retry_at_us, task.reminders, task.refusals = winner, call, None, 0, 0
        self.in_vain.over(task.car)
        self.on_won(task)
        return self._note(task)

    def _note(self, task: BayTask) -> list[Effect]:
        """Who may fetch its car, in the journal; of a car that is not there yet it has nothing."""
        if task.is_coming:
            return []
        return self.stewardship.won(task.car, task.winner, task.task, task.version)

    def call_again(self, task: BayTask, now_us: int) -> list[Effect]:
        """Its winner gave the task back, or is lost: it is called anew under a raised version, noted before said."""
        task.winner, task.version = 0, successor(task.version, TASK_VERSION_BITS)
        effects = self._note(task)
        outcome = self.fleet.negotiation.abandon(task.task, Reason.NODE_SILENT, now_us)
        effects += [item for item in outcome if not isinstance(item, EVENT_TYPES)]
        return effects + self.call_for(task, now_us)

    def call_for(self, task: BayTask, now_us: int) -> list[Effect]:
        """Call for a task; a car that stands at no place is asked for again later."""
        source, sink = self.station.number, open_end(task.car_class)
        if task.operation is Operation.RETRIEVE:
            where = custody.place_of(self.fleet, task.car)
            if where is None:
                task.retry_at_us = now_us + RETRY_US
                return [Report(f"car {task.car.number} is nowhere to be fetched from")]
            source, sink = where.number, source
        task.retry_at_us = None
        self.stewardship.called(task.task)
        return list(self.fleet.negotiation.open(task.terms(source, sink, self.floor), now_us))

    def call_for_who_comes(self, car: Reference, ready_us: int, now_us: int) -> list[Effect]:
        """A robot for a car that drives in; its bay is locked at ``ready_us``, bus time."""
        self.job = BayTask(car, Operation.PARK, car, 0, ready_us=ready_us, is_coming=True)
        return self.call_for(self.job, now_us)

    def has_come(self, wheelbase_mm: int) -> list[Effect]:
        """It stands in the bay, and has a ticket: what was won before is noted."""
        assert self.job is not None
        self.job.is_coming, self.job.wheelbase_mm = False, wheelbase_mm
        return self._note(self.job) if self.job.winner else []

    def not_come(self, now_us: int) -> list[Effect]:
        """Nobody brings a car, or another than was thought: the task is over before it began."""
        job, self.job = self.job, None
        assert job is not None
        return self.call_off(job, now_us)

    def call_off(self, task: BayTask, now_us: int) -> list[Effect]:
        """Nobody is to do a task any more: whoever has won it, or might, hears so."""
        self.in_vain.over(task.car)
        outcome = self.fleet.negotiation.call_off(task.task, Reason.CANCELLED, now_us)
        over = bay_task.void_award(self.fleet.node_id, task.task)
        return [*(item for item in outcome if not isinstance(item, EVENT_TYPES)), Send(over)]

    def review(self, now_us: int) -> list[Effect]:
        """As custodian: winners that are lost; for my own tasks I call anew at once."""
        effects = self.stewardship.review(now_us)
        taken_back = bool(effects)
        effects += self.unsaid.review(now_us)
        if self.fleet.slots_told is not None and self.forgot is None:
            self.forgot = True
        for task in self.in_hand():
            if task.is_brought(self.fleet.mirror, self.fleet.node_id, self.station):
                continue
            # Nobody has a right by an award that was not heard: its car is mine, and goes to the winner only.
            is_lost = (
                taken_back and self.stewardship.is_given_back(task.car)
                if task.winner
                else self._is_unheard(task, now_us)
            )
            if is_lost:
                effects += self.call_again(task, now_us)
            effects += self._ask(task, now_us)
        ahead = self.ahead
        if ahead is not None and not (ahead.winner or ahead.call or ahead.retry_at_us or self._is_open(ahead)):
            effects += self.settle(ahead, now_us)
        if ahead is not None and ahead.retry_at_us is not None and ahead.retry_at_us <= now_us and not self._is_full:
            effects += (
                self._drop_ahead() if bay_task.is_gone(ahead.car, self.fleet.mirror) else self.call_for(ahead, now_us)
            )
        return effects

    @property
    def _is_full(self) -> bool:
        """Whether nobody has won the car that stands in the bay, or comes: the next would stand before a full bay."""
        return self.job is not None and self.job.operation is Operation.PARK and not self.job.winner

    def _drop_ahead(self) -> list[Effect]:
        """The car of the next task has left from another bay."""
        ahead, self.ahead = self.ahead, None
        return [] if ahead is None else [ahead_over_record(ahead.task)]

    def outs(self) -> int:
        """How many cars that go out are in hand."""
        return sum(task.operation is Operation.RETRIEVE for task in self.in_hand())

    def give_up(self, car: Reference | None, phase: BayPhase, now_us: int) -> tuple[list[Effect], bool]:
        """A car goes out at another bay: whoever has won to fetch it here hears so; whether the bay waited for it."""
        task = None if car is None else self.of_car(car)
        is_job = task is self.job
        if task is None or not self._is_still_to_come(task, phase):
            return [], False
        over = job_over_record() if is_job else ahead_over_record(task.task)
        self.job, self.ahead = (None, self.ahead) if is_job else (self.job, None)
        return [over, *self.call_off(task, now_us)], is_job

    def _is_still_to_come(self, task: BayTask, phase: BayPhase) -> bool:
        """Whether a task is about a car that goes out, and its robot has not had the bay."""
        waits = task is not self.job or (not task.was_granted and phase in (BayPhase.LOCKING, BayPhase.AWAITING))
        return task.operation is Operation.RETRIEVE and waits

    def refused(self, task: BayTask, reason: Reason, now_us: int) -> list[Effect]:
        """Nobody could: what is said of it."""
        task.refused(reason, now_us)
        what = f"{task.operation.name.lower()} car {task.car.number}"
        return [Report(f"nobody can {what}: {reason.name}; called again later")]

    def put_behind(self, task: BayTask, phase: BayPhase, tickets: deque[Reference]) -> tuple[list[Effect], bool]:
        """Nobody can fetch a car: its ticket waits behind all others; whether the bay waited for it.

        The ticket is noted before the task is over, so that no crash loses it.
        """
        if not self._is_still_to_come(task, phase):
            return [], False
        bay_task.queue_ticket(tickets, task.car, urgent=False)
        self.in_vain.put(task, tickets)
        noted: list[Effect] = [ticket_record(task.car, urgent=False)]
        if task is self.job:
            return noted, True
        self.ahead = None
        return [*noted, ahead_over_record(task.task)], False

    def bay_came_back(self, now_us: int, *, is_loaded: bool) -> tuple[BayPhase | None, list[Effect]]:
        """The robot that had the bay gives it back: the next phase, None while it has the car or sensors are behind.

        One that did nothing there had lost the task before it had the right: whoever has it now is waited for.
        """
        if self._is_next_here and (swapped := self.swap()):
            return BayPhase.CLOSING, swapped
        job = self.job
        assert job is not None
        is_mine = custody.is_mine(self.fleet, job.car)
        is_parked = job.operation is Operation.PARK
        is_placed = is_mine and custody.place_of(self.fleet, job.car) is not None
        # A car in my own custody at a place has left, whatever a sensor that is silent now has said last; one that was
        # fetched may be out already: its driver took it while this machine was off.
        if is_parked and not is_mine:
            self.unsaid.begins(job.task, job.car)
        if (is_placed or not is_loaded) if is_parked else (is_loaded or (is_mine and not is_placed)):
            # A car that is mine, by all that I heard, and in the bay no more: who took it says where it is.
            is_elsewhere = is_parked and is_mine and not is_placed and job.winner
            return BayPhase.CLOSING, [Send(job.award(self.fleet.node_id))] if is_elsewhere else []
        holder = self.fleet.tokens.holder_of(car_token(*job.car))
        if not is_mine and (is_parked or (holder == job.winner and holder != NOBODY)):
            return None, []
        job.was_granted = False
        if job.winner:
            # It may have put the car back after it lost its journal: it says at once whether it still has the task.
            return BayPhase.AWAITING, [Send(job.award(self.fleet.node_id))]
        is_nobodys = job.retry_at_us is None and not self._is_open(job)
        return BayPhase.AWAITING, self.settle(job, now_us) if is_nobodys else []

    def has_another(self, robot: int) -> bool:
        """Whether the car of the task that has the bay, to be brought here, is neither this robot's nor here."""
        job = self.job
        record = None if job is None else self.fleet.mirror.cars.get(job.car)
        if job is None or job.operation is Operation.PARK or record is None:
            return False
        return record.custodian not in (robot, self.fleet.node_id) or custody.place_of(self.fleet, job.car) is not None

    def swap(self) -> list[Effect]:
        """The car of the next task comes before that of the job, for which nothing is in the bay: it goes out first.

        One record says both, so that no crash comes between. No effect where the robot that has asked for the bay has
        no right to the slot in front of it, which one has at a time, or has another car aboard, or none: but where that
        car is here already.
        """
        robot, self.asks_too = self.asks_too, NOBODY
        job, ahead, slot = self.job, self.ahead, Segment(self.station.track, self.station.index)
        if job is None or ahead is None or job.operation is Operation.PARK:
            return []
        record, is_here = self.fleet.mirror.cars.get(ahead.car), self._is_next_here
        is_there = ahead.winner == robot and self.fleet.tokens.holder_of(segment_token(slot)) == robot
        is_aboard = record is not None and (record.custodian, record.station) == (robot, ANY_STATION)
        if not (is_here or (is_there and is_aboard)):
            return []
        self.job, self.ahead, ahead.was_granted = ahead, job, ahead.was_granted or is_here
        return [job_record(ahead.task, Operation.RETRIEVE, ahead.car, ahead.wheelbase_mm)]

    def settle(self, task: BayTask, now_us: int) -> list[Effect]:
        """Taken up from the journal without a winner: whoever has it says so first.

        An award may have been said that was not noted: what is said from now on is newer.
        """
        task.retry_at_us, task.version = now_us + SETTLING_US, successor(task.version, TASK_VERSION_BITS)
        return self._note(task)

    def _ask(self, task: BayTask, now_us: int) -> list[Effect]:
        """Say again whose a task is while its winner shows nothing of it: who does not know of it gives it back.

        What either side remembers of the other may be of a late word, or of none: only plans, which all come to agree
        on, prove for as long as I wait that somebody comes.
        """
        record = self.fleet.mirror.cars.get(task.car)
        is_aboard = record is not None and record.station == ANY_STATION and task.operation is Operation.RETRIEVE
        if record is not None and is_aboard and record.custodian != task.winner:
            # Whoever brings it here has it, whomever a word was believed that came late.
            return [] if self._work_here(record.custodian) is None else self.won_by(task, record.custodian, 0)
        if self.is_shown(task):
            task.unshown_us = task.ask_at_us = None
            return []
        if task.unshown_us is None or task.ask_at_us is None:
            task.unshown_us, task.ask_at_us = now_us, now_us + ASK_AGAIN_US
        lost_us = task.unshown_us + NOTHING_SHOWN_US
        if now_us >= lost_us and not self._may_work(task):
            return self.call_again(task, now_us)
        if now_us < task.ask_at_us:
            return []
        task.ask_at_us = lost_us if now_us < lost_us else now_us + ASK_AGAIN_US
        return [Send(task.award(self.fleet.node_id))]

    def _may_work(self, task: BayTask) -> bool:
        """Whether the winner has work, or a right to the car: then it may be about this task, whatever it shows."""
        plan, holder = self.fleet.mirror.itineraries.get(task.winner), self.fleet.tokens.holder_of(car_token(*task.car))
        return holder == task.winner or (plan is not None and has_work(plan))

    def is_shown(self, task: BayTask) -> bool:
        """Whether the winner has the task by its plan, or its car by its word; or nobody can be asked, or need be."""
        record = self.fleet.mirror.cars.get(task.car)
        is_its = record is not None and record.custodian == task.winner
        is_no_question = not task.winner or task.was_granted or task.winner in self.fleet.mirror.obstacles.machines
        return is_no_question or is_its or self._work_here(task.winner) is not None

    def _is_open(self, task: BayTask) -> bool:
        return any(one.terms.task == task.task for one in self.fleet.negotiation.initiators)

    def next_wake(self, phase: BayPhase) -> int | None:
        """When a call is made again, or a winner counts as lost; the job's call only where its phase waits for it."""
        is_given_back = self.job is not None and self.job.is_given_back
        is_asked = phase is BayPhase.AWAITING or (phase is BayPhase.HANDOVER and is_given_back)
        tasks = [None if self._is_full else self.ahead, self.job if is_asked else None]
        times = [task.retry_at_us for task in tasks if task is not None]
        times += [task.ask_at_us for task in self.in_hand()]
        times += [self.stewardship.next_wake(), self.unsaid.next_wake()]
        return min([one for one in times if one is not None], default=None)

    def done_at_us(self, task: BayTask | None, now_us: int) -> int | None:
        """When the winner of a task in hand will have been at the bay, by its plan, bus us; None where it told of none.

        A robot that has both does what is ahead last.
        """
        works = [] if task is None else self._works_here(task.winner)
        has_both = self.job is not None and self.ahead is not None and self.job.winner == self.ahead.winner
        if not works or (task is self.ahead and has_both and len(works) == 1):
            return None
        return from_bus_ms(works[-1 if task is self.ahead else 0].end_ms, now_us)

    def brings(self, node: int) -> bool:
        """Whether a machine with a car aboard has to leave it at the bay, by its plan.

        It takes and leaves by turns: an even number of works begins with the one that it has done since it told them.
        """
        plan = self.fleet.mirror.itineraries.get(node)
        works = [] if plan is None else [leg for leg in plan.legs if leg.action is LegAction.WORK]
        work = next(iter(works[1 - len(works) % 2 :]), None)
        return work is not None and (work.track, work.to_index, work.side) == tuple(self.station)

    def _work_here(self, node: int) -> Leg | None:
        """What a machine does first at the bay by its plan."""
        return next(iter(self._works_here(node)), None)

    def _works_here(self, node: int) -> list[Leg]:
        plan, here = self.fleet.mirror.itineraries.get(node), tuple(self.station)
        at_bay = [leg for leg in (plan.legs if plan else ()) if (leg.track, leg.to_index, leg.side) == here]
        return [leg for leg in at_bay if leg.action is LegAction.WORK]
