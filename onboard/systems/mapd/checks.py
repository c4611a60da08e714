"""Rules of a pick-up and delivery site, from the frames alone: steps, cells, tasks, bids, awards and paths."""

from collections.abc import Callable
from dataclasses import dataclass, field

from onboard.contract.mapd import PathHead, PathMoves, StepRound, StepState, StepTurn
from onboard.contract.messages import Award, Bid, CallForProposals
from onboard.systems.mapd.calls import is_of_step, mark_of, task_of
from onboard.systems.mapd.fields import MOVE_BITS, MOVES_A_FRAME
from onboard.systems.mapd.site import Mapd
from onboard.trace.check.calls import CROSSING_US
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rights import OneHolder
from onboard.trace.check.rule import Handlers, Rule

_MASK = (1 << MOVE_BITS) - 1


class _OnFloor(Rule):
    """A rule that looks cells up."""

    needs_site = True

    def place(self, cell: int) -> int | None:
        """What standing in a cell takes; None for no cell of this site."""
        site = self.picture.site
        is_known = isinstance(site, Mapd) and cell < site.floor.size
        return site.floor.resources[cell] if isinstance(site, Mapd) and is_known else None

    def is_way(self, cell: int, to: int) -> bool:
        """Whether one step leads there; staying is one."""
        site = self.picture.site
        if cell == to or not isinstance(site, Mapd):
            return True
        return cell < site.floor.size and to in site.floor.ways[cell]


class OneACell(_OnFloor):
    """In no step two robots in one cell or zone, no two that change places, nobody beside the ways (row P59).

    And nobody is two steps ahead of another: each waits for all.
    """

    name = "one-a-cell"
    title = "in every step one robot a cell, no swaps, and nobody two steps ahead"
    source = "Ma, Li, Kumar and Koenig (AAMAS 2017)"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._at: dict[int, dict[int, int]] = {}
        self._step: dict[int, int] = {}

    def handlers(self) -> Handlers:
        """Robots' words on their steps."""
        return {StepState: self._on_state}

    def _on_state(self, event: LogEvent[StepState]) -> None:
        state = event.message
        here, step, robot = self._at.setdefault(state.step, {}), state.step, state.sender
        known = here.get(robot)
        if known is not None:
            if known != state.cell:
                self.find(event, (robot,), f"says of step {step} once cell {known} and once cell {state.cell}")
            return
        if step <= self._step.get(robot, -1):
            return  # said again, long after
        self._step[robot] = step
        late = [other for other, at in self._step.items() if at < step - 1]
        if late:
            self.find(event, (robot, *late), f"is in step {step}, and node {late[0]} in step {self._step[late[0]]}")
        place = self.place(state.cell)
        others = tuple(other for other, cell in here.items() if self.place(cell) == place)
        if others or place is None:
            self.find(event, (robot, *others), f"cell {state.cell} in step {step} holds {1 + len(others)} robots")
        here[robot] = state.cell
        self._judge_move(event, here)
        for old in [one for one in self._at if one < step - 3]:
            del self._at[old]

    def _judge_move(self, event: LogEvent[StepState], here: dict[int, int]) -> None:
        state = event.message
        before = self._at.get(state.step - 1, {})
        came = before.get(state.sender)
        if came is None:
            return
        if not self.is_way(came, state.cell):
            self.find(event, (state.sender,), f"comes from cell {came} to {state.cell}, where no way leads")
        for other, cell in here.items():
            if other != state.sender and came != state.cell and (before.get(other), cell) == (state.cell, came):
                self.find(event, (state.sender, other), f"change places in cells {came} and {cell}")


class TaskOnce(Rule):
    """A task is taken aboard by one robot, where it is, and served once, where it is to go."""

    name = "task-once"
    title = "every task is carried by one robot, from its pick-up to its delivery"
    source = "row P59; issue: two owners of a task never happen"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._calls: dict[int, CallForProposals] = {}
        self._carrier: dict[int, int] = {}
        self._cells: dict[int, tuple[int, ...]] = {}
        self._served: dict[int, tuple[int, int]] = {}
        self._aboard: dict[int, int] = {}

    def handlers(self) -> Handlers:
        """Reads calls, and robots' words of their tasks."""
        return {CallForProposals: self._on_call, StepState: self._on_state}

    def _on_call(self, event: LogEvent[CallForProposals]) -> None:
        self._calls[event.message.task.number] = event.message

    def _on_state(self, event: LogEvent[StepState]) -> None:
        state, robot = event.message, event.message.sender
        # A log that begins in the middle, or whose clock began anew, takes what is aboard for granted.
        is_midway = robot not in self._cells and state.step > 0
        cells = self._cells[robot] = (*self._cells.get(robot, ())[-1:], state.cell)
        call = self._calls.get(state.task)
        if state.loaded:
            first = self._carrier.setdefault(state.task, robot)
            # Also where the call was not heard: said again later, it makes no news of what is aboard.
            is_news = self._is_news(state) and not is_midway
            if first != robot:
                self.find(event, (first, robot), f"both have task {state.task}")
            elif call is not None and is_news and call.from_station not in cells:
                self.find(event, (robot,), f"has task {state.task} aboard and was not in cell {call.from_station}")
        if state.served:
            before = self._served.setdefault(state.task, (robot, state.step))
            if before != (robot, state.step):
                self.find(event, (before[0], robot), f"task {state.task} is served twice")
            if call is not None and call.to_station not in cells:
                self.find(event, (robot,), f"served task {state.task} and was not in cell {call.to_station}")

    def _is_news(self, state: StepState) -> bool:
        known = self._aboard.get(state.sender)
        self._aboard[state.sender] = state.task
        return known != state.task


@dataclass
class _RoundSeen:
    """One round: bids as (time us, cost, robot) by task, and each robot's last."""

    opened: StepRound
    bids: dict[int, list[tuple[int, int, int]]] = field(default_factory=dict)
    last: dict[int, tuple[int, int]] = field(default_factory=dict)
    is_closed: bool = False


class RoundsGoDown(Rule):
    """In a round each bid beats those for its task before it; each award goes to the best of the last bids."""

    name = "rounds-go-down"
    title = "bids of a round strictly better, and awards to the best"
    source = "rows P07, P08, P11; design 4"
    undisturbed = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._round: _RoundSeen | None = None

    def handlers(self) -> Handlers:
        """Reads rounds, bids and awards of each step."""
        return {StepRound: self._on_round, Bid: self._on_bid, StepTurn: self._on_turn, Award: self._on_award}

    def _on_round(self, event: LogEvent[StepRound]) -> None:
        word = event.message
        known = None if self._round is None else self._round.opened
        if known is None or (word.step, word.attempt) != (known.step, known.attempt):
            self._round = _RoundSeen(word)

    def _on_bid(self, event: LogEvent[Bid]) -> None:
        bid, seen, task = event.message, self._round, task_of(event.message)
        if seen is None:
            return
        if bid.itinerary_version != mark_of(seen.opened) or seen.is_closed:
            self.find(event, (bid.sender,), f"bids for task {task} in no open round")
            return
        before = seen.bids.setdefault(task, [])
        better = [one for one in before if one[1:] < (bid.cost, bid.sender) and one[0] < event.time_us - CROSSING_US]
        if better:
            what = f"bids {bid.cost} for task {task} after node {better[0][2]} bid {better[0][1]}"
            self.find(event, (bid.sender, better[0][2]), what)
        before.append((event.time_us, bid.cost, bid.sender))
        seen.last[bid.sender] = (bid.cost, task)

    def _on_turn(self, event: LogEvent[StepTurn]) -> None:
        if self._round is not None and event.message.step == self._round.opened.step:
            self._round.is_closed = True

    def _on_award(self, event: LogEvent[Award]) -> None:
        award, seen = event.message, self._round
        if seen is None or not is_of_step(award, seen.opened.step):
            return
        seen.is_closed = True
        number = award.task.number
        rivals = [(cost, robot) for robot, (cost, task) in seen.last.items() if task == number]
        if not rivals or min(rivals)[1] != award.winner:
            self.find(event, (award.sender, award.winner), f"task {number} to node {award.winner}, no best bid")


@dataclass
class _PathHeard:
    """A path that is being told, or was."""

    head: PathHead
    parts: dict[int, int] = field(default_factory=dict)
    cells: list[int] | None = None

    def at(self, step: int) -> int | None:
        """Cell at a step, the last one for ever; None before the path begins."""
        if self.cells is None or step < self.head.step:
            return None
        return self.cells[min(step - self.head.step, len(self.cells) - 1)]


class PathsApart(_OnFloor):
    """The newest paths of any two robots never meet, from the later one's first step on, nor do their rests."""

    name = "paths-apart"
    title = "no two paths meet or change places"
    source = "Ma, Li, Kumar and Koenig (AAMAS 2017); design 5: every itinerary ends in a refuge"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._coming: dict[int, _PathHeard] = {}
        self._paths: dict[int, _PathHeard] = {}

    def handlers(self) -> Handlers:
        """Reads the paths that robots publish."""
        return {PathHead: self._on_head, PathMoves: self._on_moves}

    def _on_head(self, event: LogEvent[PathHead]) -> None:
        known = self._paths.get(event.message.sender)
        if known is not None and (known.head == event.message or event.message.step < known.head.step):
            return
        self._coming[event.message.sender] = _PathHeard(event.message)
        self._complete(event, event.message.sender)

    def _on_moves(self, event: LogEvent[PathMoves]) -> None:
        path_heard = self._coming.get(event.message.sender)
        if path_heard is not None and event.message.version == path_heard.head.version:
            path_heard.parts[event.message.part] = event.message.codes
            self._complete(event, event.message.sender)

    def _complete(self, event: LogEvent[PathHead] | LogEvent[PathMoves], robot: int) -> None:
        path_heard, site = self._coming[robot], self.picture.site
        if len(path_heard.parts) * MOVES_A_FRAME < path_heard.head.moves or not isinstance(site, Mapd):
            return
        cells = [path_heard.head.cell]
        for number in range(path_heard.head.moves):
            part, place = divmod(number, MOVES_A_FRAME)
            code = path_heard.parts.get(part, 0) >> MOVE_BITS * place & _MASK
            ways = site.floor.ways[cells[-1]] if cells[-1] < site.floor.size else ()
            if code > len(ways):
                self.find(event, (robot,), f"its path leaves the ways after cell {cells[-1]}")
                return
            cells.append(ways[code - 1] if code else cells[-1])
        path_heard.cells = cells
        del self._coming[robot]
        self._paths[robot] = path_heard
        for other, path in self._paths.items():
            if other != robot:
                self._judge_pair(event, robot, path_heard, other, path)

    def _judge_pair(
        self,
        event: LogEvent[PathHead] | LogEvent[PathMoves],
        robot: int,
        path_heard: _PathHeard,
        other: int,
        path: _PathHeard,
    ) -> None:
        first = max(path_heard.head.step, path.head.step)
        last = max(one.head.step + one.head.moves for one in (path_heard, path)) + 1
        before: tuple[int | None, int | None] = (None, None)
        for step in range(first, last + 1):
            mine, theirs = path_heard.at(step), path.at(step)
            assert mine is not None and theirs is not None
            swap = mine != theirs and before == (theirs, mine)
            if self.place(mine) == self.place(theirs) or swap:
                self.find(event, (robot, other), f"paths meet in cell {mine} at step {step}")
                return
            before = (mine, theirs)


#: What a log of a pick-up and delivery site is judged by: the rules of every system that apply, and its own. Calls that
#: stand are judged round by round.
RULES: tuple[type[Rule], ...] = (
    OneHolder,
    OneACell,
    TaskOnce,
    RoundsGoDown,
    PathsApart,
)
