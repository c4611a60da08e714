"""Customers: served, or told why (issue 4, point 1)."""

from collections import OrderedDict
from collections.abc import Callable

from onboard.contract.codes import CallResult, DeskInput, DeskText, Operation, TaskPhase
from onboard.contract.constants import OUTSIDE
from onboard.contract.messages import (
    Award,
    BayState,
    CallForProposals,
    CarAt,
    DeskEvent,
    DeskOrder,
    OperatorOrder,
    Reference,
    TaskReport,
)
from onboard.core.site import Station
from onboard.systems.car_park.bay_task import DESK_INPUT, KEYS, class_in
from onboard.systems.car_park.site import CarPark
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers, Rule
from onboard.ways.site import way_site

#: A customer who pressed the key before a car in the bay gets a word within this, us: calls, attempts and their windows
#: take less.
WORD_WITHIN_US = 60_000_000
#: A customer gets the car, or the place, within this, us: some thirty cars before one on the shipped sites.
SERVED_WITHIN_US = 3_600_000_000

#: Whose car has been brought, or is given back, needs no other word, whoever presses a key then.
_ANSWERS_TO_KEY = (
    DeskText.CAR_READY,
    DeskText.TAKE_TICKET,
    DeskText.FULL,
    DeskText.CAR_TOO_LARGE,
    DeskText.NO_CHARGING,
    DeskText.OUT_OF_ORDER,
)


class TasksServed(Rule):
    """Every task that a compartment calls for is done in the end, or refused with a reason."""

    name = "tasks-served"
    liveness = True
    title = "every task is done, or refused with a reason"
    source = "issue 4, point 1"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._open: OrderedDict[Reference, LogEvent[CallForProposals]] = OrderedDict()
        self._told: set[Reference] = set()

    def handlers(self) -> Handlers:
        """Reads calls, awards and reports of tasks."""
        return {CallForProposals: self._on_call, TaskReport: self._on_report, Award: self._on_award}

    def _on_call(self, event: LogEvent[CallForProposals]) -> None:
        call = event.message
        if call.depth == 0 and call.operation in (Operation.PARK, Operation.RETRIEVE):
            self._open.setdefault(call.task, event)

    def _on_report(self, event: LogEvent[TaskReport]) -> None:
        report = event.message
        if report.phase is TaskPhase.REFUSED and not report.reason:
            self.find(event, (report.sender,), f"task {report.task.origin}.{report.task.number} is refused without why")
        if report.phase in (TaskPhase.DONE, TaskPhase.REFUSED):
            self._close(report.task)

    def _on_award(self, event: LogEvent[Award]) -> None:
        award = event.message
        opened = self._open.get(award.task)
        if award.result is CallResult.WITHDRAWN and opened is not None and opened.message.sender == award.sender:
            self._close(award.task)

    def _close(self, task: Reference) -> None:
        self._open.pop(task, None)
        self._told.discard(task)

    def tick(self, now_us: int) -> None:
        """Tasks that are open for too long."""
        for task, event in self._open.items():
            if self.picture.waited_us(event.time_us, now_us) <= SERVED_WITHIN_US:
                return
            if task not in self._told:
                self._told.add(task)
                what = f"task {task.origin}.{task.number} is open for {SERVED_WITHIN_US // 1_000_000} s"
                self.find(event, (task.origin,), what)


class CustomersServed(Rule):
    """Whoever presses the key with a car in the bay, or puts a ticket in, gets a word, and then the car."""

    name = "customers-served"
    liveness = True
    title = "every customer served, or told why"
    source = "issue 4, point 1; docs/decisions.md, flag 6"
    on_devices = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._loads_kg: dict[int, int] = {}
        self._asked: dict[int, LogEvent[DeskEvent]] = {}
        self._answered: set[int] = set()
        self._tickets: dict[tuple[int, Reference], LogEvent[DeskEvent]] = {}
        self._told: set[tuple[int, Reference]] = set()

    def handlers(self) -> Handlers:
        """Reads what desks are asked and show, and what bays sense."""
        return {DeskEvent: self._on_event, DeskOrder: self._on_word, BayState: self._on_bay}

    def _on_bay(self, event: LogEvent[BayState]) -> None:
        node = event.message.sender
        self._loads_kg[node] = event.message.load_kg
        if not event.message.load_kg:
            self._asked.pop(node, None)
            self._answered.discard(node)

    def _on_event(self, event: LogEvent[DeskEvent]) -> None:
        node, desk_event = event.message.sender, event.message
        if desk_event.event not in KEYS:
            self._tickets.setdefault((node, desk_event.car), event)
        elif self._loads_kg.get(node) and node not in self._answered:
            self._asked.setdefault(node, event)

    def _on_word(self, event: LogEvent[DeskOrder]) -> None:
        node, word = event.message.sender, event.message
        if word.text in _ANSWERS_TO_KEY:
            self._asked.pop(node, None)
            self._answered.add(node)
        if word.text is DeskText.GO_TO:
            # From now on the car is waited for there, whichever desk has said so.
            asked = [self._tickets.pop(one) for one in list(self._tickets) if one[1] == word.car]
            if asked:
                self._tickets[word.compartment, word.car] = asked[0]
        if word.text in (DeskText.CAR_READY, DeskText.UNKNOWN_TICKET):
            self._tickets.pop((node, word.car), None)
            self._told.discard((node, word.car))

    def tick(self, now_us: int) -> None:
        """Who waits for too long."""
        if not (self._asked or self._tickets):
            return
        for node, event in list(self._asked.items()):
            if self.picture.waited_us(event.time_us, now_us) > WORD_WITHIN_US:
                del self._asked[node]
                self.find(event, (node,), "a customer pressed the key and got no word")
        for (node, car), event in self._tickets.items():
            if self.picture.waited_us(event.time_us, now_us) > SERVED_WITHIN_US and (node, car) not in self._told:
                self._told.add((node, car))
                self.find(event, (node,), f"a customer still waits for car {car.origin}.{car.number}")


class FullMeansFull(Rule):
    """Without faults a customer is refused only where no place is free for such a car."""

    name = "full-means-full"
    title = "nobody is refused while there is room"
    source = "issue 4, point 1"
    needs_site = True
    undisturbed = True
    on_devices = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._stations: dict[Reference, int] = {}
        self._bays: dict[int, BayState] = {}
        self._keys: dict[int, DeskInput] = {}

    def handlers(self) -> Handlers:
        """Cars, what bays sense, which key is pressed, and what desks say."""
        return {
            CarAt: self._on_car,
            BayState: self._on_bay,
            DeskEvent: self._on_key,
            OperatorOrder: self._on_order,
            DeskOrder: self._on_word,
        }

    def _on_car(self, event: LogEvent[CarAt]) -> None:
        said = event.message
        if said.station == OUTSIDE:
            self._stations.pop(said.car, None)
        else:
            self._stations[said.car] = said.station

    def _on_bay(self, event: LogEvent[BayState]) -> None:
        self._bays[event.message.sender] = event.message

    def _on_key(self, event: LogEvent[DeskEvent]) -> None:
        if event.message.event in KEYS:
            self._keys[event.message.sender] = event.message.event

    def _on_order(self, event: LogEvent[OperatorOrder]) -> None:
        """A key pressed from afar."""
        pressed = DESK_INPUT[event.message.action]
        if pressed in KEYS:
            self._keys[event.message.compartment] = pressed

    def _on_word(self, event: LogEvent[DeskOrder]) -> None:
        said = event.message
        if said.text not in (DeskText.FULL, DeskText.NO_CHARGING) or not self.picture.tokens.from_start:
            return
        taken, places = set(self._stations.values()), {one.number for one in way_site(self.picture.site).places}
        free = [one for one in self._suited(said.sender) if one.number not in taken]
        # A car that is on its way out keeps its place until it is fetched, one on its way in has one already.
        moving = sum(station not in places for station in self._stations.values())
        if moving < len(free):
            what = f"says {said.text.name} with {len(self._stations)} cars inside and {len(free)} places free for it"
            self.find(event, (said.sender,), what)

    def _suited(self, node: int) -> list[Station]:
        """The places for the car before a desk."""
        site, bay = way_site(self.picture.site), self._bays.get(node)
        if not isinstance(site, CarPark) or not site.classes:
            return list(site.places)
        charging = self._keys.get(node) is DeskInput.CHARGING_KEY
        car_class = class_in(bay, site, charging=charging)
        return [place for place in site.places if site.takes(place, car_class)]
