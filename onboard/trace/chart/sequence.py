"""The sequence chart of a customer's task, or of one call: who said what to whom, as text and as SVG.

The steps of a car's entry (Pujo et al. 2006, Fig. 9; row P50) are numbered where a message shows one. Steps of devices
(the car left, the key, doors, light, shuttle) show only where the log holds device buses as well.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

from onboard.contract.codes import (
    CallResult,
    DeskInput,
    DeskText,
    DoorPosition,
    DriveMode,
    LegAction,
    LightColour,
    Operation,
    ShuttleMode,
    TaskPhase,
)
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import (
    BayState,
    CallForProposals,
    DeskEvent,
    DeskOrder,
    DoorState,
    DriveState,
    Itinerary,
    Message,
    Reference,
    ShuttleState,
    TaskReport,
)
from onboard.core.site import Site
from onboard.history.calls import BidMade, CallAnswered, CallOpened
from onboard.history.history import History
from onboard.history.loads import LoadTold
from onboard.history.places import Place, PlaceTold
from onboard.history.plans import PlanTold
from onboard.history.tasks import TaskTold
from onboard.trace.chart.svg import SvgDrawing
from onboard.trace.listener import LoggedMessage
from onboard.trace.words import Words
from onboard.ways.site import way_site

#: The lane for what concerns everybody, and that of the devices and the customer.
ALL = 0
_TEXT_LANE = 15
_LANE, _ROW, _TOP, _LEFT, _NOTES = 130, 20, 50, 90, 420
#: What begins the story of a customer before the call does.
_BEGINNINGS = ("a car stands in the bay", "desk: ticket")


class Arrow(NamedTuple):
    """One message: from a node to a node, or to all; ``step`` of Fig. 9, 0 where it is none."""

    time_us: int
    sender: int
    receiver: int
    text: str
    step: int = 0


@dataclass
class SequenceChart:
    """Nodes in the order of their lanes, and arrows in the order of time."""

    title: str
    nodes: list[int]
    arrows: list[Arrow]


class _Story:
    """Picks the messages of one task."""

    def __init__(self, site: Site, task: Reference, words: Words) -> None:
        ways = way_site(site)
        self.task = task
        self.car: Reference | None = None
        self.owner = 0
        self.operation: Operation | None = None
        self.calls: set[tuple[int, int]] = set()
        self._history = History(site, is_bounded=False)
        self.offers: set[tuple[int, int]] = set()
        #: Lifts that the owner's itineraries ride with.
        self.lifts: set[int] = set()
        self._lifts = {site.stewards[track]: track for track in ways.lifts}
        self._platforms = set(ways.platforms)
        self._words = words
        self._seen: dict[object, object] = {}
        self._desk_event: DeskEvent | None = None
        self.loaded = self.over = self.pressed = False

    def arrows(self, logged: LoggedMessage) -> Iterator[Arrow]:
        """What a message adds to the chart."""
        message = logged.message
        if self.over:
            return
        for receiver, text, step in self._fleet(message, logged.time_us) if logged.is_fleet else self._device(message):
            yield Arrow(logged.time_us, message.sender, receiver, text, step)

    def _dealt(self, fact: CallOpened | BidMade | CallAnswered) -> Iterator[tuple[int, str, int]]:
        """What a message tells of the task's calls."""
        if fact.call is None or fact.call.terms.task != self.task:
            return
        call = fact.call.terms
        match fact:
            case CallOpened():
                yield from self._call(call)
            case BidMade(bid=bid):
                self.offers.add((bid.sender, bid.itinerary_version))
                step = self._park(0 if call.depth else 7)
                yield bid.initiator, f"bids {self._words.cost(bid.cost, call.criterion)}", step
            case CallAnswered():
                yield from self._answer(call, fact)

    def _fleet(self, message: Message, time_us: int) -> Iterator[tuple[int, str, int]]:
        match self._history.feed(message, time_us):
            case CallOpened() | BidMade() | CallAnswered() as fact:
                yield from self._dealt(fact)
            case PlanTold(plan=plan) if (plan.sender, plan.version) in self.offers:
                yield ALL, f"tentative itinerary, {len(plan.legs)} legs", self._park(9)
            case PlanTold(plan=plan) as fact if fact.is_firm and self._is_ours(plan):
                yield ALL, f"itinerary {plan.version}, {len(plan.legs)} legs", self._once("plan", self._park(11))
                yield from self._rides(plan)
            case TaskTold(report=report) if report.task == self.task:
                yield from self._report(report)
            case LoadTold(word=word) if word.car == self.car and self._changed("car", word.station):
                names = self._words.system
                where = "aboard" if word.station == ANY_STATION else f"at {names.place(word.station)}"
                yield ALL, f"{names.thing(word.car)} {where}", 0
            case PlaceTold(node=node, place=place):
                yield from self._place(node, place)

    def _call(self, call: CallForProposals) -> Iterator[tuple[int, str, int]]:
        self.calls.add((call.sender, call.call))
        if not call.depth:
            self.operation, self.car = call.operation, call.car
        what = self._words.system.operation(call.operation)
        way = self._words.system.way(call) or self._words.system.thing(call.car)
        yield ALL, f"call {call.call}: {what}, {way}", self._park(3 if not call.depth else 15)

    def _answer(self, call: CallForProposals, fact: CallAnswered) -> Iterator[tuple[int, str, int]]:
        award = fact.award
        if not self._changed((award.sender, award.call), (award.result, award.winner)):
            return
        if award.result is CallResult.AWARDED and not call.depth:
            self.owner = award.winner
        yield award.winner or ALL, f"call {award.call} {award.result.name.lower()}", self._park(0 if call.depth else 10)

    def _is_ours(self, plan: Itinerary) -> bool:
        key = (plan.stamp.initiator, plan.stamp.call)
        return plan.sender == self.owner and any((who, call & 0xFF) == key for who, call in self.calls)

    def _rides(self, plan: Itinerary) -> Iterator[tuple[int, str, int]]:
        """What an itinerary asks of lifts (step 15): it is the word for its rides, unless they were called for."""
        for lift, track in self._lifts.items():
            floors = [
                f"{leg.from_index} to {leg.to_index}"
                for leg in plan.legs
                if (leg.action, leg.track) == (LegAction.RIDE, track)
            ]
            if floors and self._changed(("rides", lift), floors):
                self.lifts.add(lift)
                yield lift, f"rides from floor {', '.join(floors)}", self._park(15)

    def _report(self, report: TaskReport) -> Iterator[tuple[int, str, int]]:
        if not self._changed((report.sender, report.station), report.phase):
            return
        self.loaded |= report.phase is TaskPhase.LOADED
        self.over = report.phase in (TaskPhase.DONE, TaskPhase.REFUSED)
        step = {TaskPhase.LOADED: 13, TaskPhase.DONE: 21}.get(report.phase, 0)
        names = self._words.system
        where = "" if "station" in names.silent else f", {names.place(report.station)}"
        yield ALL, f"task {report.phase.name.lower()}{where}", self._park(step)

    def _place(self, node: int, place: Place) -> Iterator[tuple[int, str, int]]:
        index = place.segment.index
        if node == self.owner:
            aboard = place.segment in self._platforms
            if self._changed("aboard", aboard) and (aboard or self._changed("boarded", True) is False):
                yield ALL, "on the platform" if aboard else "off the platform", self._after(17 if aboard else 20)
        elif node in self._lifts and self.owner and self._changed(node, index):
            yield ALL, f"lift at floor {index}", self._after(18 if place.speed_mm_s else 19)

    def _device(self, message: Message) -> Iterator[tuple[int, str, int]]:
        match message:
            case BayState() if self._changed("load", message.load_kg > 0):
                left = message.load_kg > 0
                yield (
                    message.sender,
                    "a car stands in the bay" if left else "the bay is empty",
                    int(left),
                )
            case BayState() if self._changed("front", message.carrier_in_front) and message.carrier_in_front:
                yield message.sender, "a carrier stands before the bay", self._park(12)
            case DeskEvent() if self._changed("desk", message.sequence):
                step = 2 if message.event in (DeskInput.KEY, DeskInput.CHARGING_KEY) else 0
                self.pressed |= bool(step)
                yield message.sender, f"desk: {message.event.name.lower()}", self._once("key", step)
            case DeskOrder() if message.text is DeskText.TAKE_TICKET and self._changed("ticket", message.car):
                yield message.sender, f"ticket of {self._words.system.thing(message.car)}", 2
            case DoorState():
                yield from self._doors(message)
            case ShuttleState() if message.sender == self.owner and self._changed("shuttle", message.mode):
                if message.mode in (ShuttleMode.GRIPPING, ShuttleMode.RELEASING):
                    yield message.sender, f"shuttle {message.mode.name.lower()}", 0
            case DriveState() if message.sender == self.owner and message.mode is DriveMode.MOVING:
                if self._once("moves", 1):
                    yield message.sender, "begins to move", self._park(12)

    def _doors(self, state: DoorState) -> Iterator[tuple[int, str, int]]:
        """Closing comes before opening, whatever the figure's numbers say (flag 5)."""
        if self._changed("light", state.light):
            red = state.light is LightColour.RED
            yield state.sender, f"light {state.light.name.lower()}", self._bay(5 if red else 14)
        if self._changed("input", state.input_door) and state.input_door in (DoorPosition.LOCKED, DoorPosition.OPEN):
            shut = state.input_door is DoorPosition.LOCKED
            yield state.sender, f"input door {state.input_door.name.lower()}", self._bay(5 if shut else 14)
        if self._changed("output", state.output_door) and state.output_door in (DoorPosition.LOCKED, DoorPosition.OPEN):
            shut = state.output_door is DoorPosition.LOCKED
            yield state.sender, f"output door {state.output_door.name.lower()}", self._bay(14 if shut else 6)

    def _park(self, step: int) -> int:
        """Fig. 9 is of a car's entry; retrieval has no listing (flag 6)."""
        return step if self.operation is Operation.PARK else 0

    def _bay(self, step: int) -> int:
        is_park = self.operation is Operation.PARK or (self.operation is None and self.pressed)
        return step if is_park and (step == 14) is self.loaded else 0

    def _after(self, step: int) -> int:
        """Steps of the lift come after loading: the car may be parked without one."""
        return self._park(step) if self.loaded else 0

    def _once(self, key: object, step: int) -> int:
        return step if self._changed(("once", key), 1) else 0

    def _changed(self, key: object, value: object) -> bool:
        before = self._seen.get(key)
        self._seen[key] = value
        return before != value


def chart(site: Site, logged: Iterable[LoggedMessage], task: Reference) -> SequenceChart | None:
    """The chart of a task, None where the log does not hold it. What the bay's devices said just before counts in."""
    words = Words(site)
    story = _Story(site, task, words)
    arrows: list[Arrow] = []
    for one in logged:
        words.hear(one.message)
        if not one.is_fleet and one.message.sender not in (task.origin, story.owner):
            continue
        arrows += story.arrows(one)
    begun_us = next((one.time_us for one in arrows if one.text.startswith("call ")), None)
    if begun_us is None:
        return None
    came_us = [one.time_us for one in arrows if one.time_us <= begun_us and one.text in _BEGINNINGS]
    arrows = [one for one in arrows if one.time_us >= (came_us[-1] if came_us else begun_us)]
    relevant = {task.origin, story.owner, *(sender for sender, _ in story.offers)}
    winners = {one.receiver for one in arrows if one.text.startswith("call ")}
    relevant = {node for node in relevant | winners | story.lifts if node}
    arrows = [one for one in arrows if one.sender in relevant]
    return SequenceChart(f"task {words.reference(task)}", sorted(relevant), arrows)


def as_text(found: SequenceChart, words: Words, start_us: int) -> list[str]:
    """Lanes of characters; ``o`` a message to all, ``>`` and ``<`` to one, ``*`` of a machine's own devices."""
    head = " " * 17 + "".join(f"{words.machine(node):<{_TEXT_LANE}}" for node in found.nodes)
    lines = [found.title, head.rstrip()]
    for arrow in found.arrows:
        step = f"{arrow.step:>3}" if arrow.step else "   "
        lines.append(f"{(arrow.time_us - start_us) / 1e6:11.3f} s{step} {_lanes(found, arrow)}  {arrow.text}")
    return lines


def _lanes(found: SequenceChart, arrow: Arrow) -> str:
    row = [("|" + " " * (_TEXT_LANE - 1)) for _ in found.nodes]
    text = list("".join(row)[: _TEXT_LANE * (len(found.nodes) - 1) + 1])
    start = found.nodes.index(arrow.sender) * _TEXT_LANE
    if arrow.receiver in found.nodes and arrow.receiver != arrow.sender:
        end = found.nodes.index(arrow.receiver) * _TEXT_LANE
        low, high = sorted((start, end))
        text[low + 1 : high] = "-" * (high - low - 1)
        text[end] = ">" if end > start else "<"
        text[start] = "+"
    else:
        text[start] = "*" if arrow.receiver == arrow.sender else "o"
    return "".join(text)


def as_svg(found: SequenceChart, words: Words, start_us: int) -> SvgDrawing:
    """Lifelines with arrows; a message to all goes to every lane."""
    width = _LEFT + _LANE * len(found.nodes) + _NOTES
    drawing = SvgDrawing(width, _TOP + _ROW * (len(found.arrows) + 2), found.title)
    drawing.text(8, 16, found.title)
    lanes = {node: _LEFT + _LANE * number + _LANE / 2 for number, node in enumerate(found.nodes)}
    for node, x in lanes.items():
        drawing.text(x, _TOP - 10, words.machine(node), anchor="middle")
        drawing.line([(x, _TOP), (x, _TOP + _ROW * (len(found.arrows) + 1))], "#999999", dash="3 3")
    for number, arrow in enumerate(found.arrows):
        y = _TOP + _ROW * (number + 1)
        x = lanes[arrow.sender]
        drawing.text(_LEFT - 8, y + 4, f"{(arrow.time_us - start_us) / 1e6:.3f} s", anchor="end", fill="#666666")
        if arrow.receiver == arrow.sender:
            drawing.area([(x - 4, y - 4), (x + 4, y - 4), (x + 4, y + 4), (x - 4, y + 4)], "#009E73", opacity=1)
        elif arrow.receiver in lanes:
            drawing.arrow(x, lanes[arrow.receiver], y, "#D55E00")
        else:
            for other in lanes.values():
                if other != x:
                    drawing.arrow(x, other, y, "#0072B2")
        step = f"[{arrow.step}] " if arrow.step else ""
        drawing.text(_LEFT + _LANE * len(found.nodes) + 6, y + 4, step + arrow.text)
    return drawing
