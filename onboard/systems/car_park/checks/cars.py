"""Cars: conserved, one custodian each, one in a place (issue 4, point 1)."""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

from onboard.contract.codes import TaskPhase, TokenKind
from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import CarAt, Reference, TaskReport
from onboard.core.serial import is_newer
from onboard.core.site import Station
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers, Rule
from onboard.trace.check.tokens_seen import Token
from onboard.ways.site import way_site

#: Bits by which versions of cars' statements compare (``CarAt`` in dbc/fleet.dbc).
VERSION_BITS = 16
#: Cars remembered after they left; older ones are forgotten, since their numbers come again some day.
MOST_CARS = 4_096
#: The statement of a car may come so long after the report that names its place, us.
STATED_WITHIN_US = 1_000_000


@dataclass
class CarSeen:
    """Where a car was stated to be last, by whom and under which version."""

    station: int
    by: int
    version: int


class CarsConserved(Rule):
    """A car comes in by a compartment, goes on and off shuttles, and leaves by a compartment; none is lost or doubled.

    The same fold tells whether two cars are stated in one place or on one shuttle.
    """

    name = "cars-conserved"
    title = "cars conserved, one in a place"
    source = "issue 4, point 1"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._cars: OrderedDict[Reference, CarSeen] = OrderedDict()
        self._at: dict[int, Reference] = {}
        self._aboard: dict[int, Reference] = {}

    def handlers(self) -> Handlers:
        """Reads where cars are said to stand."""
        return {CarAt: self._on_car}

    def _on_car(self, event: LogEvent[CarAt]) -> None:
        claim = event.message
        if self.picture.tokens.is_frozen(event.time_us):
            # All say where they remember a lost machine's car: each repeats another's word.
            return
        before = self._cars.get(claim.car)
        if before is not None and is_newer(before.version, claim.version, VERSION_BITS):
            return
        wrong = self._judge_new(claim) if before is None else self._judge_step(claim, before)
        wrong = wrong or self._judge_place(claim)
        if wrong:
            self.find(event, (claim.sender,), f"car {claim.car.origin}.{claim.car.number} {wrong}")
        self._take_up(claim)

    def _judge_new(self, claim: CarAt) -> str:
        if not self.picture.tokens.from_start:
            return ""
        if not self.picture.has_site:
            return ""
        started_again = self.picture.boots.get(claim.sender, 1) > 1
        if started_again and claim.station == OUTSIDE and claim.car.origin == claim.sender:
            # It came and went while nobody acknowledged a frame, and what was to say so was lost with that life.
            return ""
        bay = way_site(self.picture.site).compartments.get(claim.sender)
        if bay is None or claim.station != bay.number or claim.car.origin != claim.sender:
            return f"is {_where(claim.station)} and never came in"
        return ""

    def _judge_step(self, claim: CarAt, before: CarSeen) -> str:
        step = f"from {_where(before.station)} to {_where(claim.station)}"
        if before.station == claim.station:
            same = claim.station != ANY_STATION or claim.sender == before.by
            return "" if same else f"from shuttle {before.by} to shuttle {claim.sender}"
        if before.station == OUTSIDE:
            return f"goes {step}"
        if claim.station == OUTSIDE:
            return "" if self._is_bay(before.station) else f"goes {step}"
        if ANY_STATION not in (before.station, claim.station):
            return f"goes {step} on no shuttle"
        if before.station == ANY_STATION and claim.sender != before.by:
            handed = self.picture.tokens.under(Token(TokenKind.CAR, _number(claim.car)), claim.version)
            if handed is None or handed.giver != before.by:
                return f"goes {step}, by the word of {claim.sender}, from the shuttle of {before.by}"
        return ""

    def _judge_place(self, claim: CarAt) -> str:
        if claim.station == OUTSIDE:
            return ""
        other = self._aboard.get(claim.sender) if claim.station == ANY_STATION else self._at.get(claim.station)
        if other is None or other == claim.car:
            return ""
        return f"is {_where(claim.station)}, where car {other.origin}.{other.number} is"

    def _take_up(self, claim: CarAt) -> None:
        for places in (self._at, self._aboard):
            for place in [place for place, car in places.items() if car == claim.car]:
                del places[place]
        if claim.station == ANY_STATION:
            self._aboard[claim.sender] = claim.car
        elif claim.station != OUTSIDE:
            self._at[claim.station] = claim.car
        self._cars[claim.car] = CarSeen(claim.station, claim.sender, claim.version)
        self._cars.move_to_end(claim.car)
        if len(self._cars) > MOST_CARS:
            oldest = next((car for car, seen in self._cars.items() if seen.station == OUTSIDE), None)
            if oldest is not None:
                del self._cars[oldest]

    def _is_bay(self, station: int) -> bool:
        if not self.picture.has_site:
            return station != ANY_STATION
        return any(bay.number == station for bay in way_site(self.picture.site).compartments.values())


class OneCustodian(Rule):
    """Only the holder of a car's token states where the car is, and the report of a task agrees with it."""

    name = "one-custodian"
    title = "one custodian a car"
    source = "dbc/fleet.dbc, CarAt; design 5"

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._stated: OrderedDict[tuple[int, int], int] = OrderedDict()
        self._open: list[tuple[LogEvent[TaskReport], int]] = []
        #: The place that each machine named last: a report may be long held up, while nobody acknowledges frames.
        self._named: dict[int, int] = {}
        #: What each machine has told itself to have taken: a report may be said again after the whole site was off.
        self._loaded: OrderedDict[tuple[int, Reference], None] = OrderedDict()

    def handlers(self) -> Handlers:
        """Statements about cars, and reports that a car was put down."""
        return {CarAt: self._on_car, TaskReport: self._on_report}

    def tick(self, now_us: int) -> None:
        """A report of a car put down is followed by the statement where it is, if it does not follow it."""
        while self._open and now_us - self._open[0][1] > STATED_WITHIN_US:
            event, reported_us = self._open.pop(0)
            report = event.message
            if self._named.get(report.sender) == report.station:
                continue
            stated_us = self._stated.get((report.sender, report.station))
            if stated_us is None or stated_us < reported_us - STATED_WITHIN_US:
                what = f"put a car down {_where(report.station)} and does not say which"
                self.find(event, (report.sender,), what)

    def _on_car(self, event: LogEvent[CarAt]) -> None:
        claim = event.message
        if self.picture.tokens.is_frozen(event.time_us):
            # Whoever remembers where a lost machine's car stands says so in its place.
            return
        self._stated[claim.sender, claim.station] = event.time_us
        self._named[claim.sender] = claim.station
        self._stated.move_to_end((claim.sender, claim.station))
        if len(self._stated) > MOST_CARS:
            self._stated.popitem(last=False)
        token = Token(TokenKind.CAR, _number(claim.car))
        handover = self.picture.tokens.under(token, claim.version)
        custodian = handover.holder if handover is not None else claim.car.origin if claim.version == 1 else None
        last = self.picture.tokens.last(token)
        if custodian is None and last is not None and is_newer(claim.version, last.version, VERSION_BITS):
            what = f"states car {claim.car.origin}.{claim.car.number} under version {claim.version}, which nobody gave"
            self.find(event, (claim.sender, last.holder), what)
        self.picture.unjudged += custodian is None
        if custodian not in (None, claim.sender):
            car = f"car {claim.car.origin}.{claim.car.number}"
            what = f"states {car} under version {claim.version}, whose custodian is {custodian}"
            self.find(event, (claim.sender, custodian or 0), what)

    def _on_report(self, event: LogEvent[TaskReport]) -> None:
        report = event.message
        if report.phase is TaskPhase.LOADED:
            self._loaded[report.sender, report.task] = None
            if len(self._loaded) > MOST_CARS:
                self._loaded.popitem(last=False)
        elif report.phase is TaskPhase.DONE and (report.sender, report.task) in self._loaded:
            # Said again after a restart it is about a place that may have been named long ago.
            del self._loaded[report.sender, report.task]
            self._open.append((event, event.time_us))
        elif report.phase is TaskPhase.DONE:
            self.picture.unjudged += 1


def _where(station: int) -> str:
    if station == ANY_STATION:
        return "aboard"
    return "outside" if station == OUTSIDE else f"at {Station.from_number(station)}"


def _number(car: Reference) -> int:
    return car.origin << 16 | car.number
