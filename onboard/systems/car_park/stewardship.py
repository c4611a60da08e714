"""A fixed machine as steward of a track: grants segments in passing order, keeps stored cars and their places.

As custodian of a car it alone may take the right to fetch it from a machine that won it and is lost: while it holds the
car and its station, and the winner neither stands at that front nor holds its token (design, section 4). It forgets the
winner, journals that, and then says FORFEITED; whoever wants the task done calls anew under a raised version.
"""

from dataclasses import dataclass, field

from onboard.contract.codes import CallResult, Operation, Reason, TaskPhase, TokenKind
from onboard.contract.constants import NOBODY, OUTSIDE, TASK_VERSION_BITS
from onboard.contract.messages import (
    Award,
    BayState,
    CallForProposals,
    CarAt,
    Halted,
    Itinerary,
    ManualState,
    Message,
    Reference,
    TaskReport,
    TokenGrant,
)
from onboard.core.authority import TokenKey, station_token
from onboard.core.effects import Effect, Send
from onboard.core.mirror import Obstacle
from onboard.core.negotiation.winners import patience_us
from onboard.core.serial import is_newer, successor
from onboard.core.site import Station
from onboard.systems.car_park import bay_task, custody
from onboard.systems.car_park.bay_memory import BayMemory, job_record, winner_record
from onboard.systems.car_park.site import car_park
from onboard.ways.mirror import WayFleet
from onboard.ways.tokens import car_token
from onboard.work.manual import says_held

#: Calls remembered to know which car an award is about; older ones are long closed.
MAX_CALLS = 64
#: Cars that have left and are told still.
MOST_GONE = 4
#: A winner that has said nothing for so long since its award does not know of it, or does not act on it, us: a little
#: longer than its initiator says the award again at a quick pace.
UNHEARD_AFTER_US = 6_000_000
#: FORFEITED is said again this often until the task is called anew, us: a lost word would leave a customer waiting.
SAY_AGAIN_US = 2_000_000


@dataclass
class Stewardship:
    """Grant rules and custody of one steward. ``winners`` names the machine that may fetch a car."""

    fleet: WayFleet
    winners: dict[Reference, int] = field(default_factory=dict)
    #: The task that each car's winner has won and its version.
    tasks: dict[Reference, tuple[Reference, int]] = field(default_factory=dict)
    _cars_of_calls: dict[tuple[int, int], Reference] = field(default_factory=dict)
    #: A car in my own bay, compartment, that I know nothing of but by others since my rights were made anew.
    left: CarAt | None = None
    #: The robot that has a task for it, by the robot's own word.
    _claimant: int = NOBODY
    _say_at_us: dict[Reference, int] = field(default_factory=dict)
    #: Who brought each car that was put down, and for which task: it says once more where that was.
    _brought: dict[Reference, tuple[int, Reference]] = field(default_factory=dict)
    #: For which task each car was brought that was done then: who missed that may say its award again.
    _done: dict[Reference, Reference] = field(default_factory=dict)
    #: Since when the winner of each car has said nothing that shows that it knows of its award.
    _unheard_us: dict[Reference, int] = field(default_factory=dict)
    #: How often I was admitted, and since when I take part: what others did not do before is no sign of theirs.
    _admissions: int = 0
    _since_us: int = 0

    def __post_init__(self) -> None:
        self._park = car_park(self.fleet.site)
        self.fleet.tokens.before_taking = self._before_taking
        self.fleet.mirror.on_forgotten.append(self._forget)

    def replay(self, memory: BayMemory) -> None:
        """Take up what the journal tells of the cars that are in my custody still."""
        in_hand = {memory.job[2]} if memory.job is not None else set()
        in_hand |= {memory.ahead[1]} if memory.ahead is not None else set()

        def is_mine(car: Reference) -> bool:
            # Of all others their custodians know who may fetch them.
            return car in in_hand or car_token(*car) in self.fleet.tokens.held

        self.winners.update({car: winner for car, winner in memory.winners.items() if is_mine(car)})
        self.tasks.update({car: task for car, task in memory.tasks.items() if is_mine(car)})
        custody.replay(self.fleet, memory.cars.values())

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Learn from calls and awards, and who acts on them; state a car anew when its token has come to me."""
        match message:
            case TaskReport() | Itinerary():
                self._acts(message)
                return self._put_right(message) if isinstance(message, TaskReport) else []
            case CallForProposals() if self._is_for_a_car(message):
                self.called(message.task)
                self._cars_of_calls[message.sender, message.call] = message.car
                while len(self._cars_of_calls) > MAX_CALLS:
                    del self._cars_of_calls[next(iter(self._cars_of_calls))]
            case Award() if message.result is CallResult.AWARDED:
                car = self._cars_of_calls.get((message.sender, message.call))
                if car is not None and self._is_news(car, message):
                    self._unheard_us[car] = now_us
                    return self.won(car, message.winner, message.task, message.task_version)
            case Award() if message.result is CallResult.WITHDRAWN:
                self.called(message.task)
                return self.call_off(message.task) if self._park.quiet_moves else []
            case ManualState() | Halted() if says_held(message):
                self.fleet.negotiation.trust.excuse(message.sender)
            case TokenGrant() if message.token_kind is TokenKind.CAR and message.holder == self.fleet.node_id:
                return self._state_anew(custody.car_of(message), message.version)
        return []

    def _acts(self, word: TaskReport | Itinerary) -> None:
        """A winner knows of its award; or it has done what it had won, by which it may fetch nothing any more."""
        for won in [won for won in self._unheard_us if self.winners.get(won) == word.sender]:
            # Of a task that its winner has, or had; its plan is told anew with each that it takes on.
            if isinstance(word, Itinerary) or self.tasks[won][0] == word.task:
                del self._unheard_us[won]
        if isinstance(word, TaskReport) and word.phase is TaskPhase.DONE:
            done = (car for car, (task, _) in self.tasks.items() if task == word.task)
            # In my custody that ends with the car's own right.
            for car in [one for one in done if self.winners.get(one) == word.sender]:
                if not self.fleet.tokens.holds(car_token(*car)):
                    del self.winners[car]

    def _put_right(self, done: TaskReport) -> list[Effect]:
        """Where a car stands by the word of who brought it, whose ``CarAt`` before its token was missed.

        All that was heard then was where it stood before, under the same version.
        """
        brought = (car for car, by in self._brought.items() if by == (done.sender, done.task))
        car = next(brought, None) if done.phase is TaskPhase.DONE else None
        record = None if car is None else self.fleet.mirror.cars.get(car)
        if car is None or record is None or not custody.keeps(self.fleet, done.station):
            return []
        self._done[car] = self._brought.pop(car)[1]
        is_right = record.station in (done.station, OUTSIDE) or record.custodian != self.fleet.node_id
        return [] if is_right else custody.state(self.fleet, car, done.station, record.wheelbase_mm)

    def _is_for_a_car(self, call: CallForProposals) -> bool:
        """Whether its winner may fetch a stored car: only a compartment, or a person's station, calls for that."""
        machine = self.fleet.site.machines.get(call.sender)
        is_from_whom = machine is None or call.sender in self.fleet.site.compartments
        return is_from_whom and call.operation in (Operation.PARK, Operation.RETRIEVE)

    def won(self, car: Reference, winner: int, task: Reference, version: int) -> list[Effect]:
        """``winner`` may fetch a car, or with 0 nobody may, for ``task`` under ``version``."""
        if winner:
            self.winners[car] = winner
            self._say_at_us.pop(car, None)
        else:
            self.winners.pop(car, None)
            self._unheard_us.pop(car, None)
        self.tasks[car] = task, version
        return [winner_record(car, winner, task, version)]

    def claimed(self, report: TaskReport, memory: BayMemory) -> list[Effect]:
        """The winner of the task in hand by its own word: all are asked at a restart, and the journal may know of none.

        The award was said, and the power failed before it was noted.
        """
        if memory.job is None:
            return []
        task, _, car, _ = memory.job
        winner, version = self.winner_of(car, task)
        if report.task != task or report.phase is not TaskPhase.AWARDED or winner:
            return []
        return self.won(car, report.sender, task, successor(version, TASK_VERSION_BITS))

    def called(self, task: Reference) -> None:
        """Whoever calls for a task, or wants nobody to do it, knows that its winner has no right any more."""
        if self._say_at_us:
            for car in [car for car, (one, _) in self.tasks.items() if one == task]:
                self._say_at_us.pop(car, None)

    def call_off(self, task: Reference) -> list[Effect]:
        """Nobody is to move a car any more; who has a right to it already does so all the same, or gives it back."""
        mine = [(car, version) for car, (one, version) in self.tasks.items() if one == task and self._is_untouched(car)]
        for car, _ in mine:
            self._say_at_us.pop(car, None)
        return [effect for car, version in mine for effect in self.won(car, NOBODY, task, version)]

    def winner_of(self, car: Reference, task: Reference) -> tuple[int, int]:
        """Who may fetch a car for ``task``, 0 for nobody, and its version; what was won for another does not count."""
        known, version = self.tasks.get(car, (task, 1))
        return (self.winners.get(car, NOBODY), version) if known == task else (NOBODY, 1)

    def _is_news(self, car: Reference, award: Award) -> bool:
        """Whether an award is news: not under an older version of the same task, nor of a task that is done."""
        if self._done.get(car) == award.task:
            return False
        task, version = self.tasks.get(car, (award.task, 0))
        if task != award.task or is_newer(award.task_version, version, TASK_VERSION_BITS):
            return True
        return award.task_version == version and self.winners.get(car) not in (None, award.winner)

    def gone(self) -> list[Effect]:
        """The car that by others' words stands in my bay is not there: its driver has taken it while I was off."""
        car, self.left = self.left, None
        record = None if car is None else self.fleet.mirror.cars.get(car.car)
        if car is None or record is None or record.station != car.station:
            return []
        return custody.state(self.fleet, car.car, OUTSIDE, car.wheelbase_mm)

    def claims_bay(self, report: TaskReport, memory: BayMemory) -> bool:
        """Whether a robot has the right to my bay, or to the car in it, for a task that the journal has lost.

        Of such a task only the robot knows; one to park has its car's name.
        """
        bay = self.fleet.machine.station
        is_begun = report.phase in (TaskPhase.AWARDED, TaskPhase.STARTED) and memory.job is None
        if bay is None or not is_begun or report.task.origin != self.fleet.node_id:
            return False
        holder_of, stands = self.fleet.tokens.holder_of, self.fleet.mirror.car_station(report.task) == bay
        has_bay = stands and holder_of(station_token(bay)) == report.sender
        if not has_bay and holder_of(car_token(*report.task)) != report.sender:
            return False
        if self.left is not None and self.left.car != report.task:
            return False
        self.left = self.left or CarAt(report.sender, report.task, bay.number, 0, 0)
        memory.was_granted, self._claimant = has_bay, report.sender
        return True

    def parks_again(self, left: CarAt, memory: BayMemory, bay: BayState | None) -> list[Effect]:
        """A task for the car that stands in my bay, for the journal; where a robot claims it, that one's own."""
        wheelbase_mm = left.wheelbase_mm or (0 if bay is None else bay.wheelbase_mm)
        claimant, self._claimant = self._claimant, NOBODY
        if claimant != NOBODY:
            task, noted = left.car, self.won(left.car, claimant, left.car, 1)
        else:
            task, number = memory.next_reference(self.fleet)
            noted = [number]
        memory.job = (task, Operation.PARK, left.car, wheelbase_mm)
        return [*noted, job_record(*memory.job, memory.car_class)]

    def review(self, now_us: int) -> list[Effect]:
        """Take the right to fetch a car from winners that are lost, and say so until it is called anew or off."""
        if self.fleet.admissions != self._admissions:
            self._admissions, self._since_us = self.fleet.admissions, now_us
            self._unheard_us = dict.fromkeys(self._unheard_us, now_us)
        obstacles, forgetful = self.fleet.mirror.obstacles.machines, self.fleet.forgetful
        if not (obstacles or forgetful or self._unheard_us or self.fleet.mirror.taken_over or self._say_at_us):
            return []
        effects: list[Effect] = []
        lost = {winner for winner in obstacles if self._is_lost(winner, now_us)} | (forgetful - set(obstacles))
        deaf = {car for car, since_us in self._unheard_us.items() if now_us - since_us >= UNHEARD_AFTER_US}
        of_lost = [car for car, winner in self.winners.items() if winner in lost or car in deaf]
        for car in of_lost if lost or deaf else []:
            if car in self.tasks and self._is_untouched(car):
                task, version = self.tasks[car]
                effects += self.won(car, NOBODY, task, version)
                self._say_at_us[car] = now_us
        forgetful &= set(obstacles)
        for car, statement in list(self.fleet.mirror.taken_over.items()):
            if self.fleet.tokens.holds(car_token(*car)):
                del self.fleet.mirror.taken_over[car]
                effects += custody.state(self.fleet, car, statement.station, statement.wheelbase_mm)
                own = self.fleet.site.compartments.get(self.fleet.node_id)
                self.left = statement if own is not None and statement.station == own.number else self.left
        for car in [car for car, due_us in self._say_at_us.items() if due_us <= now_us]:
            record = self.fleet.mirror.cars.get(car)
            gone = record is None or record.station == OUTSIDE
            if record is None or gone or not self.fleet.tokens.holds(car_token(*car)):
                del self._say_at_us[car]
                continue
            self._say_at_us[car] = now_us + SAY_AGAIN_US
            given_back = TaskReport(
                self.fleet.node_id, self.tasks[car][0], TaskPhase.FORFEITED, record.station, Reason.NODE_SILENT
            )
            effects.append(Send(given_back))
        return effects

    def is_given_back(self, car: Reference) -> bool:
        """Whether the right to fetch a car was taken from a winner that is lost, and not given anew."""
        return car in self._say_at_us

    def next_wake(self) -> int | None:
        """When ``review`` has something to do, bus time in us; None where nobody is lost."""
        obstacles = self.fleet.mirror.obstacles.machines
        times = [*self._say_at_us.values()]
        waited = [car for car in self._unheard_us if car in self.tasks and self._is_untouched(car)]
        times += [self._unheard_us[car] + UNHEARD_AFTER_US for car in waited]
        for car, winner in self.winners.items() if obstacles else ():
            if winner in obstacles and car in self.tasks and self._is_untouched(car):
                times.append(self._lost_at_us(obstacles[winner]))
        return min(times, default=None)

    def _is_lost(self, winner: int, now_us: int) -> bool:
        obstacle = self.fleet.mirror.obstacles.machines.get(winner)
        return obstacle is not None and now_us >= self._lost_at_us(obstacle)

    def _lost_at_us(self, obstacle: Obstacle) -> int:
        return max(obstacle.since_us, self._since_us) + patience_us(obstacle)

    def _is_untouched(self, car: Reference) -> bool:
        """Whether I hold the car and its station, and nobody has a right to the front as its winner."""
        tokens, winner = self.fleet.tokens, self.winners.get(car)
        station = self.fleet.mirror.car_station(car) if tokens.holds(car_token(*car)) else None
        if station is None or not tokens.holds(station_token(station)):
            return False
        obstacle = self.fleet.mirror.obstacles.machines.get(winner or NOBODY)
        return obstacle is None or station.segment not in obstacle.slots

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """NONE where the token may go to ``requester`` now."""
        if key.kind is TokenKind.SEGMENT:
            return self.fleet.passing_verdict(key, requester, now_us)
        if key.kind is TokenKind.CAR:
            car = Reference(key.number >> 16, key.number & 0xFFFF)
            # Of a car that has left there is nothing to fetch, whoever has won to.
            may_fetch = self.winners.get(car) == requester and not bay_task.is_gone(car, self.fleet.mirror)
            return Reason.NONE if may_fetch else Reason.TOKEN_NOT_GRANTABLE_YET
        # Where a car stands nobody may bring another: only who is to fetch it has anything to do there.
        cars = custody.others_in(self.fleet.mirror, Station.from_number(key.number))
        may_enter = all(self.winners.get(car) == requester for car in cars)
        return Reason.NONE if may_enter else Reason.TOKEN_NOT_GRANTABLE_YET

    def car_statements(self) -> list[Effect]:
        """Where each car in my custody stands, and which of them have left last: somebody may have missed that."""
        mine = [one for one in self.fleet.mirror.cars.items() if one[1].custodian == self.fleet.node_id]
        gone = [one for one in mine if one[1].station == OUTSIDE][-MOST_GONE:]
        return [
            Send(CarAt(self.fleet.node_id, car, record.station, record.version, record.wheelbase_mm))
            for car, record in mine
            if record.station != OUTSIDE or (car, record) in gone
        ]

    def _before_taking(self, grant: TokenGrant) -> list[Effect] | None:
        """A car's place goes to the journal before its token; who brings it has done what it had won.

        Another may have won already to fetch it from there: where the car stands may be known before its token comes.
        """
        effects = custody.before_taking(self.fleet, grant)
        if not effects or grant.token_kind is not TokenKind.CAR:
            return effects
        car = custody.car_of(grant)
        self._brought.pop(car, None)
        if car in self.tasks:
            self._brought[car] = grant.sender, self.tasks[car][0]
        winner = self.winners.get(car, grant.sender)
        if winner != grant.sender and car in self.tasks:
            # In the journal a new place stands for a new custody: who may fetch it then is noted behind it.
            return [*effects, winner_record(car, winner, *self.tasks[car])]
        self.winners.pop(car, None)
        self.tasks.pop(car, None)
        return effects

    def _forget(self, car: Reference) -> None:
        for table in (self.winners, self.tasks, self._say_at_us, self._unheard_us, self._brought, self._done):
            table.pop(car, None)

    def _state_anew(self, car: Reference, version: int) -> list[Effect]:
        """Say where a car stands that came into my custody; again with each repeated grant: my word was lost."""
        record = self.fleet.mirror.cars.get(car)
        if record is None or (record.custodian, record.version) != (self.fleet.node_id, version):
            return []
        return [Send(CarAt(self.fleet.node_id, car, record.station, version, record.wheelbase_mm))]
