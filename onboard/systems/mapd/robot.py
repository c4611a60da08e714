"""A robot of a pick-up and delivery site: comes to a step, bids, plans in its turn, and moves when all have planned.

It waits for everybody in every step, so that all know the same when they plan: a lost frame costs all of them time,
and no plan is ever late. What it may enter is a matter of tokens all the same: a wrong belief about others' paths holds
robots up and brings no two into one cell.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from onboard.contract.codes import KindCode, MachineState, Reason, TaskPhase
from onboard.contract.mapd import PathHead, PathMoves, StepRound, StepState, StepTurn, TurnRequest
from onboard.contract.mapd_device import CartState
from onboard.contract.messages import (
    Award,
    Bid,
    CallForProposals,
    Diagnostic,
    Message,
    Reference,
    TaskReport,
    TokenGrant,
)
from onboard.core.authority import TokenKey
from onboard.core.behaviour import NEVER_US
from onboard.core.effects import Effect, Send
from onboard.core.negotiation.bidding import ANY_TIME
from onboard.core.serial import successor, to_bus_ms
from onboard.systems.mapd.asking import ASK_US, SAID_US, TOKENS_SAID_US, questions
from onboard.systems.mapd.auction import Availability, BidWeights
from onboard.systems.mapd.bidding import Round, UnitGeneration, bid_timing
from onboard.systems.mapd.calls import CALL_AGAIN_US, mark_of
from onboard.systems.mapd.driving import Driving
from onboard.systems.mapd.fields import NO_TASK
from onboard.systems.mapd.knowledge import Knowledge
from onboard.systems.mapd.memory import path_record, read_past
from onboard.systems.mapd.moves import path_frames
from onboard.systems.mapd.paths import Path
from onboard.systems.mapd.prospects import BidList
from onboard.systems.mapd.search import find_path, is_sooner
from onboard.systems.mapd.site import Mapd
from onboard.systems.mapd.steps import LAST, STEP_TABLE, GridStepPhase, StepDeed, StepFinding
from onboard.systems.mapd.turns import Turns
from onboard.systems.mapd.waiting import WaitingPlaces
from onboard.work.plain import Plain

#: What may let a robot go on; all else, such as others' heartbeats, changes nothing for it.
_OF_INTEREST: frozenset[type[Message]] = frozenset(
    (Bid, StepState, PathMoves, PathHead, StepTurn, Award, CallForProposals, StepRound, TokenGrant)
)
#: What is said so often that a robot is to know whether it waits for it (``UnitRobot.heeds``).
_OVERHEARD = frozenset(
    (Bid, StepState, PathMoves, PathHead, StepTurn, Award, CallForProposals, TaskReport, TurnRequest, Diagnostic)
)
#: What only the desk says.
_OF_DESK = (StepTurn, Award, CallForProposals, StepRound)
#: What ends a round, and what makes a robot look for another call in it.
_OF_END: frozenset[type[Message]] = frozenset((StepTurn, Award))
_OF_CHOICE: frozenset[type[Message]] = frozenset((Bid, CallForProposals))
#: Looked up for every word that a robot hears: a member of an enumeration takes CPython 3.11 ten times as long.
_GATHER, _BID, _TURNS, _MOVE = GridStepPhase
_IDLE, _WORKING = MachineState.IDLE, MachineState.WORKING


@dataclass
class UnitRobot(Plain):
    """One robot. ``task`` is what it has won or carries, ``NO_TASK`` for none; ``step`` the step that it is in."""

    kind: KindCode = KindCode.VEHICLE
    state: MachineState = MachineState.STARTING
    rule: BidWeights = field(default_factory=BidWeights)
    generation: UnitGeneration = field(default_factory=UnitGeneration)
    phase: GridStepPhase = GridStepPhase.GATHER
    step: int = 0
    task: int = NO_TASK
    round: StepRound | None = None
    #: See ``Selective``.
    overhears: frozenset[type[Message]] = _OVERHEARD
    #: Searches made, and those that found nothing better than the former path.
    searches: int = 0
    failures: int = 0
    _bids: Round | None = None
    #: Bids of this step, also those that came before all that is needed to bid oneself.
    _heard_bids: list[Bid] = field(default_factory=list)
    _head: PathHead | None = None
    _said: StepState | None = None
    _ask_us: int | None = None
    _told_us: int | None = None
    _tokens_us: int | None = None
    #: The task that was delivered last, and the step from which it was on its way then.
    _served: tuple[int, int] = (NO_TASK, -1)
    _is_new: bool = True
    #: The cart is in the cell of the next step, which is not begun.
    _has_arrived: bool = False

    def __post_init__(self) -> None:
        site = self.fleet.site
        assert isinstance(site, Mapd)
        self.site = site
        self.knowledge = Knowledge(site.floor, site.robots, self.fleet.node_id, site.step_ms)
        self.driving = Driving(self.fleet, site, self.knowledge)
        self.turns = Turns(0)
        self._me, self._least = self.fleet.node_id, self.rule.least_weights()
        self._home = site.homes[self.fleet.node_id]
        self._own_rests = site.rests - set(site.homes.values())
        self._waiting = WaitingPlaces(site.floor, site.endpoints)
        # Each hearer takes the class that it is listed under; Any is what a dispatch table costs.
        self._hearers: dict[type[Message], Callable[[Any, int], list[Effect]]] = {
            Bid: self._on_bid,
            StepState: self._on_state,
            **dict.fromkeys((PathHead, PathMoves), self._on_path),
            **dict.fromkeys(_OF_DESK, self._on_desk),
        }
        dealing = self.fleet.negotiation
        dealing.timing, dealing.slot = bid_timing(site.timing, site.bid_window_us), ANY_TIME
        dealing.stands = lambda call: call.sender == site.desk
        dealing.is_sound = self._is_sound

    # --- the Behaviour -----------------------------------------------------------------------------------------

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Where the cart is; a cell that is not on the floor is dropped and counted."""
        if isinstance(message, CartState):
            if message.cell >= len(self.site.floor.ways):
                self.fleet.drops[Reason.VALUE_OUT_OF_RANGE] += 1
                return []
            first = self.driving.cart.state is None
            self.driving.cart.sense(message)
            self._is_new = True
            return self._begin(message) if first else []
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Everything that others say of tasks, steps, bids and paths."""
        said = type(message)
        if said in _OF_INTEREST:
            self._is_new = True
        hearer = self._hearers.get(said)
        return hearer(message, now_us) if hearer is not None else []

    def _on_bid(self, bid: Bid, now_us: int) -> list[Effect]:
        if not self.knowledge.is_possible(bid, self._least):
            self.fleet.drops[Reason.FALSE_STATEMENT] += 1
        elif bid.sender in self.site.homes:
            self._heard_bids.append(bid)
            if self._bids is not None and bid.itinerary_version == self.generation.mark:
                self._bids.hear(bid)
        return []

    def _on_state(self, state: StepState, now_us: int) -> list[Effect]:
        if self.knowledge.on_state(state) and self.phase is GridStepPhase.GATHER and self._ask_us is not None:
            # While others still come the desk has nothing to tell.
            self._ask_us = max(self._ask_us, now_us + ASK_US)
        return []

    def _on_desk(self, message: StepTurn | Award | CallForProposals | StepRound, now_us: int) -> list[Effect]:
        if message.sender != self.site.desk:
            self.fleet.drops[Reason.NOT_AUTHORISED] += 1
            return []
        match message:
            case StepTurn():
                self.turns.hear(message)
            case Award() if self.turns.on_award(message) and message.winner == self.fleet.node_id:
                return [Send(TaskReport(message.winner, message.task, TaskPhase.AWARDED, 0, Reason.NONE))]
            case CallForProposals():
                self.knowledge.on_call(message)
            case StepRound():
                self.knowledge.on_round(message.step, to_bus_ms(now_us + self.site.bid_window_us))
                self._on_round(message)
        return []

    def _on_path(self, message: PathHead | PathMoves, now_us: int) -> list[Effect]:
        known = self.knowledge
        if known.on_head(message) if isinstance(message, PathHead) else known.on_moves(message):
            self._note_taken(message.sender)
        return []

    def _on_round(self, message: StepRound) -> None:
        if message.step == self.step and message != self.round:
            self.round, self._bids = message, None
            self._heard_bids = [bid for bid in self._heard_bids if self._is_of_round(bid)]

    def _is_of_round(self, bid: Bid) -> bool:
        return self.round is not None and bid.itinerary_version == mark_of(self.round)

    def _is_sound(self, task: Reference, bid: Bid) -> bool:
        """Whether the core is to count a bid: of this round, and from somebody who may be so near."""
        return self._is_of_round(bid) and self.knowledge.is_possible(bid, self._least)

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """A cell that it is not in goes to whoever is there first by everybody's paths."""
        return self.driving.may_grant(key, requester, self.step)

    def advance(self, now_us: int) -> list[Effect]:
        """From phase to phase, as far as what was heard allows."""
        if self.driving.cart.state is None or not (self._is_new or self._is_due(now_us)):
            return []
        self._is_new = False
        self.state = _IDLE if self.task == NO_TASK else _WORKING
        effects: list[Effect] = []
        goes_on = True
        while goes_on:
            finding, missing = self._found(now_us)
            phase, deed = STEP_TABLE[self.phase, finding]
            effects += self._do(deed, missing, now_us)
            if phase is not self.phase:
                self.phase, self._ask_us = phase, now_us + ASK_US if phase is GridStepPhase.TURNS else None
            goes_on = deed not in LAST and (deed is not StepDeed.DRIVE or self._has_arrived)
        return effects

    def looks_from(self) -> int:
        """Never by itself: what it waits for is said, or due."""
        return NEVER_US

    def heeds(self, message: Message) -> bool:
        """Whether a word may let it go on, by the phase that it is in; see ``_found`` for what each phase reads."""
        said, phase = type(message), self.phase
        if self.state is not (_IDLE if self.task == NO_TASK else _WORKING):
            return said in _OF_INTEREST
        if (said is Bid or said is Award) and self._takes_part(message):
            return True
        if phase is _GATHER:
            # Before the round is told nothing else counts.
            return self.round is not None and said in _OF_INTEREST
        if phase is _MOVE:
            return said is CallForProposals or self._me not in self.knowledge.paths.by_robot
        if phase is _BID:
            return self.turns.is_complete if said in _OF_END else said in _OF_CHOICE and self._prefers_another()
        return self.turns.next_to_plan(self.knowledge.heads) in (0, self._me)

    def _takes_part(self, word: Message) -> bool:
        """Whether it takes part in the call that a bid or an award is about."""
        assert isinstance(word, Bid | Award)
        initiator = word.initiator if isinstance(word, Bid) else word.sender
        return self.fleet.negotiation.knows(initiator, word.call)

    def _prefers_another(self) -> bool:
        """Whether it would take part in another call than it did last."""
        return self._bids is None or self._bids.preferred not in (None, self._bids.looked_at)

    def next_wake(self) -> int | None:
        """When a bid, a question or an order to the body is due."""
        times = [self._ask_us, self.driving.next_wake()]
        return min((time for time in times if time is not None), default=None)

    def statements(self, now_us: int) -> list[Effect]:
        """Where it is, its path, and its rights."""
        if self._head is None or (self._told_us is not None and now_us < self._told_us + SAID_US):
            return []
        self._told_us = now_us
        effects: list[Effect] = [Send(self._said)] if self._said is not None else []
        path = self.knowledge.paths.by_robot.get(self.fleet.node_id)
        if path is not None:
            head = self._head
            effects += path_frames(self.fleet.node_id, self.site.floor, path, head.version, kept=head.kept)
        if self._tokens_us is None or now_us >= self._tokens_us + TOKENS_SAID_US:
            self._tokens_us = now_us
            effects += self.fleet.tokens.statements()
        return effects

    def _is_due(self, now_us: int) -> bool:
        due_us = self.next_wake()
        return due_us is not None and due_us <= now_us

    # --- power-up ----------------------------------------------------------------------------------------------

    def _begin(self, body: CartState) -> list[Effect]:
        """From the journal and the body: which step this is, and what the path is."""
        past = read_past(self.fleet.entries)
        path = past.path or Path(0, (body.cell,))
        self.task, self.step = past.task, past.step
        if past.step > 0 and past.step > path.start:
            # It had set out for that step: it goes there (again), and tells when it is there.
            self.step, self.phase = past.step - 1, GridStepPhase.MOVE
            # Whoever forgot meanwhile that it had come to the step before waits for that word.
            self._said = past.come_to(self.step, path, body)
        if past.served[0] == past.task:
            # Unloading had begun: on the way to this step, or before.
            self.driving.unloaded = past.task
            if past.served[1] != self.step or self.phase is not GridStepPhase.MOVE:
                self.task = NO_TASK
        self._served = past.served if self.phase is not GridStepPhase.MOVE else (NO_TASK, -1)
        self.turns = Turns(self.step)
        head = self._head_of(path, past.version, kept=False)
        self.knowledge.put(head, path)
        return path_frames(self.fleet.node_id, self.site.floor, path, past.version, kept=False)

    def _head_of(self, path: Path, version: int, *, kept: bool) -> PathHead:
        self._head = PathHead(self.fleet.node_id, path.start, path.cells[0], len(path.cells) - 1, version, kept)
        return self._head

    # --- phases ------------------------------------------------------------------------------------------------

    def _found(self, now_us: int) -> tuple[StepFinding, list[int]]:
        """What counts in this phase, and whom it misses."""
        match self.phase:
            case GridStepPhase.GATHER:
                return self._found_gathering(now_us)
            case GridStepPhase.BID if self.turns.is_complete:
                return StepFinding.CLOSED, []
            case GridStepPhase.BID:
                return StepFinding.NOT_BEGUN if self._bids is None else StepFinding.OPEN, [self.site.desk]
            case GridStepPhase.TURNS:
                return self._found_in_turns()
        if self._has_arrived:
            return StepFinding.ARRIVED, []
        if self.fleet.node_id not in self.knowledge.paths.by_robot:
            return StepFinding.MISSING, self.knowledge.pathless()
        return StepFinding.ON_PATH, []

    def _found_gathering(self, now_us: int) -> tuple[StepFinding, list[int]]:
        """All robots, their paths and the round are to be there."""
        if self._said is None or self._said.step != self.step:
            return StepFinding.UNTOLD, []
        told = self.round if self.round is not None and self.round.step == self.step else None
        if told is None and self._ask_us is not None and now_us < self._ask_us:
            return StepFinding.EARLY, []
        missing = [*self.knowledge.behind(self.step), *self.knowledge.pathless()]
        if missing or told is None:
            return StepFinding.MISSING, missing or [self.site.desk]
        if not told.bidding:
            return StepFinding.ROUND_TO_GO, []
        # Once the round is closed others may have gone on and picked up: the number is of no use any more.
        if len(self.knowledge.open_tasks) == told.open_tasks or self.turns.is_complete:
            return StepFinding.ROUND_TO_BID, []
        return StepFinding.OTHER_TASKS, [self.site.desk]

    def _found_in_turns(self) -> tuple[StepFinding, list[int]]:
        """Wait for the paths of those before me, plan if it is my turn, wait for those after me."""
        me, robot = self.fleet.node_id, self.turns.next_to_plan(self.knowledge.heads)
        if robot != me:
            return (StepFinding.MISSING, [robot]) if robot else (StepFinding.ALL_PLANNED, [])
        missing = self.knowledge.pathless()
        task = self.turns.takes(me)
        if task != NO_TASK and task not in self.knowledge.tasks:
            missing.append(self.site.desk)
        return StepFinding.MISSING if missing else StepFinding.MY_TURN, missing

    def _do(self, deed: StepDeed, missing: list[int], now_us: int) -> list[Effect]:
        match deed:
            case StepDeed.TELL:
                return self._tell(now_us)
            case StepDeed.ASK | StepDeed.ASK_TASKS:
                asked = self._ask(missing, now_us)
                if asked and deed is StepDeed.ASK_TASKS and self.round is not None:
                    self.knowledge.forget_open()
                    self._ask_us = now_us + ASK_US + 2 * CALL_AGAIN_US * self.round.open_tasks
                return asked
            case StepDeed.BEGIN_BIDS:
                return self._begin_bids(now_us)
            case StepDeed.LOOK:
                self._look(now_us)
                return self._ask(missing, now_us)
            case StepDeed.PLAN:
                return self._plan(self.turns.takes(self.fleet.node_id))
            case StepDeed.DRIVE:
                return self._drive(now_us)
            case StepDeed.NEXT_STEP:
                self._has_arrived, self.step = False, self.step + 1
                self.turns, self.round, self._bids, self._heard_bids = Turns(self.step), None, None, []
        return []

    def _tell(self, now_us: int) -> list[Effect]:
        """It has come to this step: where it is, and what it carries or has delivered on the way."""
        body = self.driving.cart.state
        assert body is not None
        served = self._served[1] == self.step - 1 and self._served[0] != NO_TASK
        task = self._served[0] if served else self.task
        self._said = StepState(self.fleet.node_id, self.step, body.cell, task, body.task != NO_TASK, served)
        self.knowledge.on_state(self._said)
        # The others may still be on their way, and the desk keeps to its pace.
        self._ask_us = now_us + self.site.step_us + ASK_US
        return [Send(self._said)]

    def _begin_bids(self, now_us: int) -> list[Effect]:
        """What each open task would cost; who is to make room for others' ends, or waits elsewhere better, says so."""
        assert self.round is not None
        offers = self._offers()
        self.generation.offers, self.generation.mark = offers, mark_of(self.round)
        self.fleet.negotiation.leave_round(self.site.desk)
        self._bids = Round(self.fleet.node_id, now_us, offers)
        for heard in self._heard_bids:
            self._bids.hear(heard)
        self._ask_us = now_us + self.site.bid_window_us + ASK_US
        return [Send(TurnRequest(self.fleet.node_id, self.step, self.round.attempt))] if self._wants_turn() else []

    def _drive(self, now_us: int) -> list[Effect]:
        """Go on by the path; a task may be delivered on the way."""
        path = self.knowledge.paths.by_robot[self.fleet.node_id]
        effects, served, self._has_arrived = self.driving.go(path, self.step, self.task, now_us)
        if served:
            self._served, self.task = (self.task, self.step), NO_TASK
        return effects

    def _look(self, now_us: int) -> None:
        """Take part in the call for the task that is cheapest among those for which nobody is better."""
        bids = self._bids
        assert bids is not None
        preferred = bids.preferred
        call = None if preferred is None else self.knowledge.calls.get(preferred)
        if call is None or preferred is None or preferred == bids.looked_at:
            return
        bids.looked_at = preferred
        until_us = bids.begun_us + self.site.bid_window_us
        self.fleet.negotiation.look(call, (bids.begun_us, until_us), bids.bids.get(preferred, ()), now_us)

    def _ask(self, nodes: list[int], now_us: int) -> list[Effect]:
        """Ask those who are missed, once everything else has been there for a while."""
        if self._ask_us is None or now_us < self._ask_us:
            return []
        self._ask_us = now_us + ASK_US
        return questions(self._me, nodes)

    # --- decisions ---------------------------------------------------------------------------------------------

    @property
    def _is_loaded(self) -> bool:
        body = self.driving.cart.state
        return body is not None and body.task != NO_TASK

    def _offers(self) -> BidList:
        """What each open task would cost: the task-generation function of this system."""
        return self.site.prospects.offers(self.rule, self._offer(), self.knowledge.open_tasks, self.step)

    def _offer(self) -> Availability:
        """Where and when it will be free: at once, or where it delivers what it carries."""
        path, me = self.knowledge.paths.by_robot[self.fleet.node_id], self.fleet.node_id
        carried = self.knowledge.tasks.get(self.task)
        if not self._is_loaded or carried is None:
            return Availability(me, path.at(self.step), 0)
        return Availability(me, carried.delivery, path.arrival(carried.delivery, self.step) - self.step)

    def _rests(self) -> frozenset[int]:
        """Where it may end: not in others' homes, nor where somebody has to pick up or deliver; its home always."""
        return self._own_rests - self.knowledge.wanted_cells | {self._home}

    def _wants_turn(self) -> bool:
        path = self.knowledge.paths.by_robot[self.fleet.node_id]
        if self.task != NO_TASK:
            return self.knowledge.is_in_the_way(self.fleet.node_id, self._home) or self._is_sooner()
        return path.rest not in self._rests() or self._waits_better(path) is not None

    def _is_sooner(self) -> bool:
        """Whether what it carries would be there sooner by another path."""
        carried = self.knowledge.tasks.get(self.task)
        if not self._is_loaded or carried is None:
            return False
        floor, paths, me = self.site.floor, self.knowledge.paths, self.fleet.node_id
        return is_sooner(floor, paths, me, self.step, carried.delivery, self._rests())

    def _waits_better(self, path: Path) -> int | None:
        """Where it would wait better than at the end of its path."""
        others = self.knowledge.others(self.fleet.node_id, self.step)
        return self._waiting.better(path.rest, others, self._rests())

    def _ends(self, old: Path, number: int) -> frozenset[int]:
        """Where its new path may end: without a task, that is not in the way, where it waits best."""
        rests = self._rests()
        if number != NO_TASK or self.task != NO_TASK or old.rest not in rests:
            return rests
        better = self._waits_better(old)
        return frozenset((old.rest if better is None else better,))

    def _goals(self, number: int) -> tuple[int, ...]:
        """What its new path leads through: that of the task that it won, or what is left of the one aboard."""
        won, aboard = self.knowledge.tasks.get(number), self.knowledge.tasks.get(self.task)
        if self._is_loaded and aboard is not None:
            return (aboard.delivery,)
        return () if won is None else (won.pickup, won.delivery)

    def _plan(self, number: int) -> list[Effect]:
        """A path for a task, or to a rest; where there is none the former path stays, and only what is aboard."""
        me, paths = self.fleet.node_id, self.knowledge.paths
        old, goals = paths.by_robot[me], self._goals(number)
        ends = self._ends(old, number)
        paths.take(me)
        self.searches += 1
        found = find_path(self.site.floor, paths, old.at(self.step), self.step, goals, ends)
        self.failures += found is None
        path = found or Path(self.step, tuple(old.at(step) for step in range(self.step, max(old.end, self.step) + 1)))
        if not self._is_loaded:
            self.task = NO_TASK if found is None or not goals else number
        version = successor(self._head.version if self._head is not None else 0, 8)
        self.knowledge.put(self._head_of(path, version, kept=found is None), path)
        self._note_taken(me)
        frames = path_frames(me, self.site.floor, path, version, kept=found is None)
        return [path_record(path, version, self.task), *frames]

    def _note_taken(self, robot: int) -> None:
        """Who plans anew right where its task is will have it aboard before it moves."""
        head = self.knowledge.heads[robot]
        task = self.knowledge.tasks.get(self.turns.takes(robot))
        if head.step == self.step and not head.kept and task is not None and task.pickup == head.cell:
            self.knowledge.taken[robot] = task.number
