"""Rules of the manufacturing cell, from the frames alone: working areas, custody of parts, who may answer a goal."""

from collections.abc import Callable
from math import isfinite

from onboard.contract.cell import ArmProgress, GoalPath, OfferHigh, OfferLow, PartAt
from onboard.contract.messages import Bid, CallForProposals, Reference
from onboard.systems.cell.fields import IN_PATH, from_halves, path_of
from onboard.systems.cell.site import Area, Cell, Point
from onboard.trace.check.calls import BidsGoDown, BidsInTime, CallsClosed
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.holds import HoldAnswered, LetGoAgain
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rights import OneHolder
from onboard.trace.check.rule import Handlers, Rule

#: Positions are whole millimetres: so far inside an obstacle is still its border, mm.
ROUNDING_MM = 1


class InsideArea(Rule):
    """A robot is in its own working area and in no obstacle, whenever it tells where it is."""

    name = "inside-area"
    title = "every robot stays in its working area and out of obstacles"
    source = "rows C01, C04"
    needs_site = True

    def handlers(self) -> Handlers:
        """Robots' words on where they are."""
        return {ArmProgress: self._on_progress}

    def _on_progress(self, event: LogEvent[ArmProgress]) -> None:
        word, site = event.message, self.picture.site
        if not isinstance(site, Cell) or word.sender not in site.arms:
            return
        here = Point(word.x_mm, word.y_mm)
        if not site.arms[word.sender].area.contains(here):
            self.find(event, (word.sender,), f"({here.x_mm}, {here.y_mm}) mm is outside its working area")
        if any(_shrunk(one).hides(here) for one in site.obstacles):
            self.find(event, (word.sender,), f"({here.x_mm}, {here.y_mm}) mm is inside an obstacle")


class PassedOn(Rule):
    """A part is stated by one custodian after the other: a robot that has passed it on does not speak of it again.

    It would be two parts under one name. The goal manager that named it gets it back in the end.
    """

    name = "part-passed-on"
    title = "no part is in two hands"
    source = "rows C04, C12"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._custodian: dict[Reference, int] = {}
        self._before: dict[Reference, set[int]] = {}

    def handlers(self) -> Handlers:
        """Reads what custodians say of parts."""
        return {PartAt: self._on_part}

    def _on_part(self, event: LogEvent[PartAt]) -> None:
        word = event.message
        last = self._custodian.get(word.part)
        if last == word.sender:
            return
        before = self._before.setdefault(word.part, set())
        if word.sender in before and word.sender != word.part.origin:
            what = f"states part {word.part.origin}.{word.part.number}, which it has passed on"
            self.find(event, (word.sender, last or 0), what)
        if last is not None:
            before.add(last)
        self._custodian[word.part] = word.sender


class PredecessorsSilent(Rule):
    """Who works on a goal already does not bid for its sub-goals."""

    name = "predecessors"
    title = "no robot bids for a sub-goal of what it works on"
    source = "row C12"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._paths: dict[Reference, tuple[int, ...]] = {}
        self._tasks: dict[tuple[int, int], Reference] = {}

    def handlers(self) -> Handlers:
        """Goals, the calls for them, and bids."""
        return {GoalPath: self._on_path, CallForProposals: self._on_call, Bid: self._on_bid}

    def _on_path(self, event: LogEvent[GoalPath]) -> None:
        word = event.message
        # Who makes a goal works on it too; a goal manager bids for nothing.
        self._paths[Reference(word.sender, word.goal)] = path_of(word, IN_PATH + 1)

    def _on_call(self, event: LogEvent[CallForProposals]) -> None:
        self._tasks[event.message.sender, event.message.call] = event.message.task

    def _on_bid(self, event: LogEvent[Bid]) -> None:
        bid = event.message
        task = self._tasks.get((bid.initiator, bid.call))
        if task is not None and bid.sender in self._paths.get(task, ()):
            self.find(event, (bid.sender, bid.initiator), f"bids for goal {task.origin}.{task.number} of its own path")


class OffersGoDown(BidsGoDown):
    """As everywhere; a bid that is not what its offer costs does not count."""

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._high: dict[tuple[int, Reference], int] = {}
        self._costs: dict[tuple[int, Reference], float] = {}

    def handlers(self) -> Handlers:
        """Reads offers beside what bids need."""
        return {**super().handlers(), OfferHigh: self._on_high, OfferLow: self._on_low}

    def _on_high(self, event: LogEvent[OfferHigh]) -> None:
        word = event.message
        self._high[word.sender, Reference(word.manager, word.goal)] = word.bits

    def _on_low(self, event: LogEvent[OfferLow]) -> None:
        word = event.message
        offer = word.sender, Reference(word.manager, word.goal)
        self._costs[offer] = from_halves(self._high.get(offer, 0), word.bits)

    def is_sound(self, bid: Bid, task: Reference) -> bool:
        """Thousandths of the offer's cost; what is no finite number is none."""
        cost = self._costs.get((bid.sender, task))
        return cost is not None and isfinite(cost) and round(1000 * cost) == bid.cost


def _shrunk(area: Area) -> Area:
    one, other = Point(area.x0_mm + ROUNDING_MM, area.y0_mm + ROUNDING_MM), ROUNDING_MM
    return Area(*one, area.x1_mm - other, area.y1_mm - other)


#: What a cell's log is judged by: the rules of every system that apply, and its own.
RULES: tuple[type[Rule], ...] = (
    OneHolder,
    CallsClosed,
    BidsInTime,
    OffersGoDown,
    InsideArea,
    PassedOn,
    PredecessorsSilent,
    LetGoAgain,
    HoldAnswered,
)
