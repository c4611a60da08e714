"""The order desk: calls for tasks, opens a round when all have come to a step, and closes it with one award a change.

It decides nothing: of two bids for a task the lower one counts, and who bids what is each robot's own affair. What it
told of a step it has written down before, so that a desk that starts again tells the same.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.contract.codes import KindCode, MachineState, OrderResult, Reason
from onboard.contract.mapd import PathHead, PathMoves, StepRound, StepState, StepTurn, TurnRequest
from onboard.contract.mapd_device import TransportAnswer, TransportKey
from onboard.contract.messages import Award, Bid, Message, Reference
from onboard.core.authority import TokenKey
from onboard.core.effects import Effect, Record, Send, Tell
from onboard.core.journal_records import Entry, records_in
from onboard.core.negotiation.winners import STANDS_AFTER_US
from onboard.core.records import BootRecord
from onboard.systems.mapd.asking import ASK_US, SAID_US, questions
from onboard.systems.mapd.calls import (
    CALL_AGAIN_US,
    CALLS_A_ROUND,
    award_of,
    call_of,
    mark_of,
    number_of,
    terms_of,
)
from onboard.systems.mapd.fields import NO_TASK
from onboard.systems.mapd.knowledge import Knowledge
from onboard.systems.mapd.records import AwardsRecord, RoundRecord, ServedRecord, TransportRecord
from onboard.systems.mapd.rights import resource_of
from onboard.systems.mapd.site import Mapd
from onboard.systems.mapd.tasks import TransportTask
from onboard.work.plain import Plain

_LOW = 1 << 16


@dataclass
class TransportDesk(Plain):
    """One desk. ``step`` is the next to be opened, or the one whose round is open (``is_open``)."""

    kind: KindCode = KindCode.DESK
    step: int = 0
    round: StepRound | None = None
    turns: list[StepTurn] = field(default_factory=list)
    awards: list[Award] = field(default_factory=list)
    is_open: bool = False
    #: Robots that asked for a turn in this round.
    asking: set[int] = field(default_factory=set)
    #: Tasks that were ordered and not served, by number, with the step from which on they are to be called for.
    orders: dict[int, TransportTask] = field(default_factory=dict)
    served: set[int] = field(default_factory=set)
    _attempt: int = 0
    _due_us: int = 0
    _changed: bool = True
    _told_us: int | None = None
    _calls_told_us: int | None = None
    #: Since when robots are missed at the step to which all have to come.
    _missed_us: int | None = None
    _close_us: int | None = None

    def __post_init__(self) -> None:
        site = self.fleet.site
        assert isinstance(site, Mapd)
        self.site = site
        self.knowledge = Knowledge(site.floor, site.robots, 0)
        self.fleet.negotiation.is_sound = self._is_sound
        self._replay(self.fleet.entries)

    def _is_sound(self, task: Reference, bid: Bid) -> bool:
        """Whether a bid counts: a robot's, of this round, and no lower than the way from where it is."""
        is_of_round = self.round is not None and bid.itinerary_version == mark_of(self.round)
        return is_of_round and bid.sender in self.site.homes and self.knowledge.is_possible(bid)

    # --- the Behaviour -----------------------------------------------------------------------------------------

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """An order that a person typed at the counter; nothing else is heard there."""
        return self._on_key(message) if isinstance(message, TransportKey) else []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Where robots are and what they carry, what they bid, and their paths: a right is given by those."""
        match message:
            case Bid() if not self.knowledge.is_possible(message):
                # Nobody is nearer than where it is.
                self.fleet.drops[Reason.FALSE_STATEMENT] += 1
            case TurnRequest() if message.sender in self.site.homes and self.is_open and self.round is not None:
                if (message.step, message.attempt) == (self.round.step, self.round.attempt):
                    self.asking.add(message.sender)
            case StepState():
                self.fleet.winners.works(message.sender, message.step, now_us)
                return self._on_state(message)
            case PathHead():
                self.knowledge.on_head(message)
            case PathMoves():
                self.knowledge.on_moves(message)
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """A cell that no robot has had yet goes to whoever is there first by the paths."""
        user = self.knowledge.next_user(resource_of(key))
        if user == requester:
            return Reason.NONE
        return Reason.MIRROR_BEHIND if user is None else Reason.TOKEN_NOT_GRANTABLE_YET

    def advance(self, now_us: int) -> list[Effect]:
        """Close the round that is over, open the step to which all have come."""
        self.state = MachineState.WORKING if self.orders else MachineState.IDLE
        if self.is_open:
            if self._close_us is None or now_us < self._close_us:
                return []
            return self._close(now_us)
        if now_us < self._due_us and self._missed_us is None:
            return []
        # Who is missed may come at any moment: the step begins with the last of them, not when it is asked again.
        missing = self.knowledge.behind(self.step)
        if missing and now_us < self._due_us:
            return []
        if missing:
            self._missed_us = now_us if self._missed_us is None else self._missed_us
            if now_us - self._missed_us >= STANDS_AFTER_US:
                # All go in step: who comes to none stops the whole floor, and only a person can help.
                for node in missing:
                    self.fleet.winners.blame_node(node, now_us)
            self._due_us = now_us + ASK_US
            return questions(self.fleet.node_id, [*self.knowledge.pathless(), *missing])
        self._missed_us = None
        return self._open(now_us)

    def next_wake(self) -> int | None:
        """The end of a round, the next step, or the next question."""
        return self._close_us if self.is_open else self._due_us

    def statements(self, now_us: int) -> list[Effect]:
        """All calls that stand or are under way, and the last round with its awards."""
        if self._told_us is not None and now_us < self._told_us + SAID_US:
            return []
        self._told_us = now_us
        effects: list[Effect] = []
        if self._calls_told_us is None or now_us >= self._calls_told_us + CALL_AGAIN_US * len(self.knowledge.tasks):
            self._calls_told_us = now_us
            effects += [self._call(task, now_us) for _, task in sorted(self.knowledge.tasks.items())]
        if self.round is not None:
            effects.append(Send(self.round))
        return effects + [Send(word) for word in (*self.awards, *self.turns)]

    # --- orders ------------------------------------------------------------------------------------------------

    def _on_key(self, key: TransportKey) -> list[Effect]:
        if key.task in self.served:
            return [Tell(TransportAnswer(self.fleet.node_id, key.task, OrderResult.DONE))]
        answer = Tell(TransportAnswer(self.fleet.node_id, key.task, OrderResult.RECEIVED))
        if key.task in self.orders:
            return [answer]
        floor = self.site.floor
        if max(key.pickup, key.delivery) >= floor.size:
            return [Tell(TransportAnswer(self.fleet.node_id, key.task, OrderResult.REFUSED))]
        release = self.step + (key.release - self.step + _LOW // 2) % _LOW - _LOW // 2
        task = TransportTask(key.task, release, key.pickup, key.delivery)
        self.orders[key.task] = task
        return [Record(TransportRecord(key.task, task.pickup, task.delivery, task.release)), answer]

    def _on_state(self, state: StepState) -> list[Effect]:
        before = self.knowledge.loads.get(state.sender)
        if not self.knowledge.on_state(state):
            return []
        self._changed |= state.served or self.knowledge.loads.get(state.sender) != before
        return self._serve(state.task) if state.served and state.task in self.orders else []

    def _serve(self, task: int) -> list[Effect]:
        """A robot had it aboard and has it no more."""
        self.orders.pop(task, None)
        self.served.add(task)
        answer = Tell(TransportAnswer(self.fleet.node_id, task, OrderResult.DONE))
        return [Record(ServedRecord(task)), answer]

    def _call(self, task: TransportTask, now_us: int) -> Effect:
        """The call for a task: said again, it is the same."""
        calls = self.knowledge.calls
        if task.number not in calls:
            calls[task.number] = call_of(self.fleet.node_id, task, now_us + self.site.bid_window_us)
        return Send(calls[task.number])

    # --- rounds ------------------------------------------------------------------------------------------------

    def _open(self, now_us: int) -> list[Effect]:
        """Call for what is due, and for bids where anything has changed or somebody has nothing to do."""
        fresh = [task for task in self.orders.values() if task.release <= self.step]
        fresh = [task for task in fresh if task.number not in self.knowledge.tasks]
        fresh = sorted(fresh, key=lambda task: (task.release, task.number))[:CALLS_A_ROUND]
        for task in fresh:
            self.knowledge.take_up(task)
        idle = any(self.knowledge.task_of(robot) == NO_TASK for robot in self.site.robots)
        bidding = bool(fresh) or self._changed or idle
        self._changed = False
        me, step, count = self.fleet.node_id, self.step, len(self.knowledge.open_tasks)
        self.round = StepRound(me, step, count, self._attempt, bidding)
        self.turns, self.awards = [], []
        self._due_us = now_us + self.site.step_us
        record = Record(RoundRecord(step, bidding, count))
        if bidding:
            self.is_open, self.asking = True, set()
            self._close_us = now_us + self.site.bid_window_us
            standing = {number_of(task.number): terms_of(me, task, step) for task in self.knowledge.open_tasks}
            self.fleet.negotiation.begin_round(standing, self._close_us)
        else:
            self.step += 1
        calls = [self._call(task, now_us) for task in sorted(fresh, key=lambda one: one.number)]
        return [record, *calls, Send(self.round)]

    def _won(self) -> dict[int, tuple[int, int]]:
        """Task and cost of each robot whose bid is the best for a task, by robot; the cheapest where bids crossed."""
        won: dict[int, tuple[int, int]] = {}
        for call, (bid, robot) in self.fleet.negotiation.best_of_round().items():
            if robot not in won or bid < won[robot][1]:
                won[robot] = call - 1, bid
        return won

    def _order(self) -> list[tuple[int, int]]:
        """Who plans, and for which task, first ones first: everybody keeps what it bid best for.

        First who lost its task or must make room, then who won, lower bids first, then who only goes where it waits, or
        by another way with what it carries.
        """
        won = self._won()
        first: list[tuple[int, int]] = []
        then: list[tuple[int, int, int]] = []
        last: list[tuple[int, int]] = []
        for robot in self.site.robots:
            before = self.knowledge.task_of(robot)
            task, bid = won.get(robot, (NO_TASK, 0))
            is_asking = robot in self.asking
            must_yield = is_asking and self.knowledge.is_in_the_way(robot, self.site.homes[robot])
            if robot in self.knowledge.loads:
                turns = first if must_yield else last
                turns += [(robot, NO_TASK)] if is_asking else []
            elif task not in (NO_TASK, before):
                then.append((bid, robot, task))
            elif must_yield or task != before:
                first.append((robot, task))
            elif task == NO_TASK and is_asking:
                last.append((robot, NO_TASK))
        return first + [(robot, task) for _, robot, task in sorted(then)] + last

    def _close(self, now_us: int) -> list[Effect]:
        """Those for whom the round is a change are told, and plan in this order."""
        order = self._order()
        me, step = self.fleet.node_id, self.step
        self.turns, self.awards = _told(me, step, order)
        self.is_open, self._close_us = False, None
        self.step += 1
        awarded = " ".join(f"{robot}:{task}" for robot, task in order)
        effects: list[Effect] = [Record(AwardsRecord(step, awarded))]
        for _, task in order:
            effects += self.fleet.negotiation.award_in_round(number_of(task), now_us) if task != NO_TASK else []
        return effects + [Send(turn) for turn in self.turns]

    # --- power-up ----------------------------------------------------------------------------------------------

    def _replay(self, entries: Iterable[Entry]) -> None:
        """What was ordered, served and told, oldest entry first."""
        me, awarded = self.fleet.node_id, None
        for record in records_in(entries, BootRecord, TransportRecord, ServedRecord, RoundRecord, AwardsRecord):
            match record:
                case BootRecord():
                    self._attempt = record.boot
                case TransportRecord():
                    task = TransportTask(record.task, record.release, record.pickup, record.delivery)
                    self.orders[record.task] = task
                case ServedRecord():
                    self.orders.pop(record.task, None)
                    self.served.add(record.task)
                case RoundRecord():
                    self.round = StepRound(me, record.step, record.open, self._attempt, record.bidding)
                    awarded, self.step = None, record.step + (not record.bidding)
                case AwardsRecord():
                    awarded, self.step = record, record.step + 1
        if self.round is not None and self.step > self.round.step and awarded is not None:
            pairs = [tuple(map(int, one.split(":"))) for one in awarded.changes.split()]
            self.turns, self.awards = _told(me, self.round.step, [(robot, task) for robot, task in pairs])
        # Tasks that were called for before are known from their release; the next round brings those of its own step.
        for task in self.orders.values():
            if self.round is not None and task.release <= self.round.step:
                self.knowledge.take_up(task)


def _told(desk: int, step: int, order: list[tuple[int, int]]) -> tuple[list[StepTurn], list[Award]]:
    """What is said of a round that has brought these changes."""
    turns = [StepTurn(desk, step, at, len(order), robot, task != NO_TASK) for at, (robot, task) in enumerate(order)]
    awards = [award_of(desk, step, robot, task) for robot, task in order if task != NO_TASK]
    return turns or [StepTurn(desk, step, 0, 0, 0, won=False)], awards
