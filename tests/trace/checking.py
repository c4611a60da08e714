"""Hand-made traces for the checkers: messages at seconds, and what came of them."""

from functools import cache

from onboard.config.site import parse_site
from onboard.contract.codes import (
    CallResult,
    Criterion,
    KindCode,
    MachineState,
    Operation,
    Reason,
    TaskPhase,
    TokenKind,
)
from onboard.contract.messages import (
    NO_REFERENCE,
    Award,
    Bid,
    BusTime,
    CallForProposals,
    CarAt,
    Heartbeat,
    Message,
    Progress,
    Reference,
    TaskReport,
    TokenGrant,
)
from onboard.core.site import Segment, Site
from onboard.trace.check.checks import Checks, LogVerdict
from tests.sites import one_floor

#: Robots of the sites below.
MR1, MR2 = 11, 12
#: Two floors of ten, a lift at the left end, one compartment at p(1,5), two robots.
TWO_FLOORS = """
[site]
name = "two-floors"
[floors]
count = 2
positions = 10
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,5)"
[[lifts]]
name = "ER1"
node = 5
end = "left"
[[robots]]
name = "MR1"
node = 11
home = "p(2,3)"
[[robots]]
name = "MR2"
node = 12
home = "p(1,9)"
"""
LIFT, ER1 = 128, 5
PLATFORM, GATE = Segment(LIFT, 0), Segment(LIFT, 255)
TASK = Reference(1, 1)
CAR = Reference(1, 1)


@cache
def one_alley() -> Site:
    """One alley of 12, the compartment at p(1,4), robots at home on p(1,12) and p(1,11)."""
    return one_floor(2)


@cache
def two_floors() -> Site:
    """See ``TWO_FLOORS``."""
    return parse_site(TWO_FLOORS, "test.toml", crowded=True)


def power_up(boot: int = 1) -> Heartbeat:
    """The first word of a site: with boot 1 the first of its life."""
    return Heartbeat(1, 1, 1, 0, boot, KindCode.COMPARTMENT, MachineState.STARTING)


class Tape:
    """A trace under way. ``started`` False: a log that begins in the middle."""

    def __init__(self, site: Site | None, *, started: bool = True, disturbed: bool = False) -> None:
        self.checks = Checks(site, disturbed=disturbed)
        self.say(0, power_up(1 if started else 2), BusTime(1, 0))

    def say(self, at_s: float, *messages: Message) -> "Tape":
        """Say messages at a time."""
        for message in messages:
            self.checks.feed_message(round(at_s * 1e6), message)
        return self

    def verdict(self, at_s: float | None = None) -> LogVerdict:
        """The end; at a time, which a heartbeat tells."""
        if at_s is not None:
            self.say(at_s, power_up())
        return self.checks.finish()

    def broken(self, at_s: float | None = None) -> dict[str, int]:
        """Broken rules and how often."""
        return dict(self.verdict(at_s).counts)


def grant(slot: Segment, version: int, giver: int, holder: int) -> TokenGrant:
    """A segment's token moves."""
    return TokenGrant(giver, TokenKind.SEGMENT, slot.number, version, holder)


def car_grant(version: int, giver: int, holder: int, car: Reference = CAR) -> TokenGrant:
    """A car's token moves."""
    return TokenGrant(giver, TokenKind.CAR, car.origin << 16 | car.number, version, holder)


def at(node: int, track: int, index: int, offset_mm: int = 0, speed_mm_s: int = 0) -> Progress:
    """A body tells where it is."""
    return Progress(node, 1, 0, track, index, offset_mm, speed_mm_s)


def car_at(sender: int, station: int, version: int, car: Reference = CAR) -> CarAt:
    """A car is stated."""
    return CarAt(sender, car, station, version, 2700)


def call(number: int = 1, deadline_s: float = 2, *, task: Reference = TASK, sender: int = 1) -> CallForProposals:
    """A call to park."""
    return CallForProposals(
        sender,
        number,
        task,
        Operation.PARK,
        KindCode.ROBOT,
        Criterion.FINISH_TIME,
        1,
        0,
        round(deadline_s * 1000),
        0x0104,
        0xFFFF,
        CAR,
        2700,
        NO_REFERENCE,
    )


def bid(sender: int, cost: int, number: int = 1) -> Bid:
    """A bid for the call."""
    return Bid(sender, 1, number, cost, 1)


def award(winner: int, result: CallResult = CallResult.AWARDED, number: int = 1, version: int = 1) -> Award:
    """The call is closed."""
    return Award(1, number, winner, TASK, version, result, Reason.NONE)


def report(sender: int, phase: TaskPhase, station: int = 0x0104, reason: Reason = Reason.NONE) -> TaskReport:
    """A phase of the task."""
    return TaskReport(sender, TASK, phase, station, reason)
