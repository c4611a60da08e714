"""The lift's gate with its platform: robots ask for both, board, ride and leave, by the shipped code of all.

Lift and robots with their journals and books of rights, the carriers' drives and the platform's; one robot, or two that
ride from different floors. Each has the alleys of its ride to itself.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from onboard.config.site import parse_site
from onboard.contract.messages import Itinerary, Message, Progress, TaskReport, Waiting
from onboard.core.authority import segment_token
from onboard.core.effects import Send
from onboard.core.records import BootRecord, TokenGoneRecord, TokenHeldRecord
from onboard.core.site import Segment
from onboard.systems.car_park.lift import Lift
from onboard.systems.car_park.lift_factory import LiftFactory
from onboard.systems.car_park.lift_steps import LiftPhase
from onboard.systems.car_park.site import CarPark, car_park
from onboard.ways.lifts import gate, platform, stop_mm
from tests.models.at_work import LEFT_OUT, AtWork, Deed, Entry
from tests.models.rides import (
    GOES_ON,
    AxisBody,
    AxisState,
    CarrierBody,
    Felt,
    PlatformBody,
    RidingFactory,
    drives,
)
from tests.models.snapshot import NOW_US, WHILE_US

LIFT, FIRST, SECOND = 5, 11, 12
_SITE = """
[site]
name = "shaft"
[floors]
count = 4
positions = 4
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,4)"
[[lifts]]
name = "ER1"
node = 5
end = "left"
[[robots]]
name = "MR1"
node = 11
home = "p(1,2)"
[[robots]]
name = "MR2"
node = 12
home = "p(2,2)"
"""
#: Where each robot stands at first, before a sill, and where it wants to be.
HOMES = {FIRST: Segment(1, 1), SECOND: Segment(2, 1)}
GOALS = {FIRST: Segment(3, 1), SECOND: Segment(4, 1)}


def _shaft() -> CarPark:
    """Four floors at one lift; each robot is steward of the alleys of its ride."""
    park = car_park(parse_site(_SITE, "shaft.toml", crowded=True))
    owners = {place.track: node for ends in (HOMES, GOALS) for node, place in ends.items()}
    machines = {node: replace(machine, home=HOMES.get(node, machine.home)) for node, machine in park.machines.items()}
    return replace(park, machines=machines, stewards={**park.stewards, **owners})


SITE = _shaft()
(SHAFT,) = SITE.lifts
GATE, PLATFORM = segment_token(gate(SHAFT)), segment_token(platform(SHAFT))
PITCH_MM = SITE.tracks[1].pitch_mm
STOPS_MM = tuple(stop_mm(SITE, SHAFT, index) for index in range(1, SITE.tracks[SHAFT].length + 1))
#: Of what others leave out the carriage counts here, but for what it remembers to be quick.
_LEFT_OUT = (LEFT_OUT - {"carriage"}) | {"_settled", "_permit", "effort", "ahead", "sites"}


def is_said(word: Message) -> bool:
    """All but what nobody here heeds; of robots only how far they have come in their plans, where they stand."""
    is_under_way = isinstance(word, Progress) and word.sender != LIFT and word.speed_mm_s != 0
    return not is_under_way and not isinstance(word, Waiting | TaskReport)


class View(NamedTuple):
    """Of one machine: whether it holds gate and platform, how its drive is, and whether it has come to its end."""

    has_gate: bool
    has_platform: bool
    drive: AxisState
    is_over: bool
    felt: Felt | None


@dataclass
class _Rider(AtWork):
    """Lift or robot; what plans say of times is no time that passes, and mirrors that differ are made equal."""

    def starts(self) -> list[Deed]:
        """The body has come to a stand; plans of another life are others."""
        if not isinstance(self.behaviour, Lift):
            self.behaviour.generation.life = self.boot
        return super().starts()

    def waits(self, down: Any) -> list[Deed]:
        """Whose mirror differs by the heartbeats asks: plans are said again."""
        behaviour = self.behaviour
        said: list[Deed] = []
        if isinstance(behaviour, Lift):
            behaviour._made = {robot: begin_us + WHILE_US for robot, begin_us in behaviour._made.items()}
            if behaviour.ride is not None:
                behaviour.ride = replace(behaviour.ride, begin_us=behaviour.ride.begin_us + WHILE_US)
        elif self.takes_part:
            told = [one.message for one in behaviour.statements(NOW_US)[:2] if isinstance(one, Send)]
            said += [self._of_life(word) for word in told if isinstance(word, Itinerary | Progress)]
        return [*said, *super().waits(down)]

    def _takes_up(self, word: Message) -> list[Any]:
        if isinstance(word, Progress):
            self.fleet.mirror.on_progress(word)
        return super()._takes_up(word)


@dataclass
class GatePart:
    """One lift, and one robot or two."""

    nodes: tuple[int, ...] = (LIFT, FIRST, SECOND)
    left_out: frozenset[str] = _LEFT_OUT
    prelude: int = 1
    #: Whether the first robot stands on the platform, at its own floor, and has gate and platform.
    aboard: bool = False

    def journal(self, node: int) -> tuple[Entry, ...]:
        """All have lived before."""
        boot = BootRecord(1).entry
        if not self.aboard or node == SECOND:
            return (boot,)
        record = TokenGoneRecord if node == LIFT else TokenHeldRecord
        return (boot, *(record(key.kind, key.number, 1, FIRST).entry for key in (GATE, PLATFORM)))

    def body(self, node: int) -> AxisState:
        """Robots before their sills, the platform where nobody wants it."""
        if node == LIFT:
            return AxisState(STOPS_MM[0 if self.aboard else -1])
        return AxisState(-PITCH_MM if self.aboard and node == FIRST else 0, floor=HOMES[node].track)

    def made(self, node: int, journal: tuple[Entry, ...], body: Any) -> AtWork:
        """Lift or robot."""
        if node == LIFT:
            moved: AxisBody = PlatformBody(node, body, stops_mm=STOPS_MM)
            return _Rider(SITE, node, LiftFactory(), moved, journal, lambda one: drives(moved, one), is_said)
        carrier = CarrierBody(node, body, pitch_mm=PITCH_MM)
        return _Rider(
            SITE, node, RidingFactory(goals=GOALS), carrier, journal, lambda one: drives(carrier, one), is_said
        )

    def hears(self, node: int, word: Message) -> bool:
        """Robots hear the lift's words that are for all, or for them; the lift hears everybody."""
        addressee = getattr(word, "holder", getattr(word, "requester", getattr(word, "whom", 0))) or node
        return LIFT in (node, word.sender) and addressee == node

    def is_within(self, machine: AtWork) -> bool:
        """Its rights have moved seldom."""
        return True

    def goes_on(self, body: AxisState) -> str | None:
        """Whoever is on the way."""
        return None if body.target_mm is None else GOES_ON

    def feels(self, i: int, view: View, bodies: tuple[AxisState, ...]) -> Felt | None:
        """Only the platform has sensors for others."""
        if self.nodes[i] != LIFT:
            return None
        places = [robot.position_mm for robot in bodies[1:]]
        felt = Felt(-PITCH_MM in places, any(place % PITCH_MM for place in places))
        return None if felt == view.felt else felt

    def view(self, machine: AtWork) -> View:
        """See ``View``."""
        behaviour, tokens = machine.behaviour, machine.fleet.tokens
        is_lift = isinstance(behaviour, Lift)
        body = machine.body
        assert isinstance(body, AxisBody)
        place = None if is_lift else behaviour.carriage.standing_at
        is_over = behaviour.phase is LiftPhase.FREE if is_lift else place == GOALS[machine.node]
        return View(tokens.holds(GATE), tokens.holds(PLATFORM), body.now, is_over, body.felt)

    def wrong(self, views: tuple[Any, ...]) -> str:
        """What must not be, by where all bodies are."""
        holders = [one for one in views if isinstance(one, View)]
        if sum(one.has_gate for one in holders) > 1:
            return "two have the gate"
        if sum(one.has_platform for one in holders) > 1:
            return "two have the platform"
        lift, *robots = [one.drive if isinstance(one, View) else one for one in views]
        if sum(robot.position_mm < 0 or robot.target_mm == -PITCH_MM for robot in robots) > 1:
            return "two are on the platform"
        for robot in robots:
            if robot.target_mm is None and robot.position_mm % PITCH_MM == 0:
                continue
            if lift.target_mm is not None:
                return "the platform moves with a robot on its sill"
            if lift.position_mm != STOPS_MM[robot.floor - 1]:
                return "a robot is over a sill while the platform is elsewhere"
        return ""

    def is_over(self, views: tuple[Any, ...]) -> bool:
        """All are where they wanted to be, and the platform is free."""
        if not all(isinstance(one, View) and one.is_over for one in views):
            return False
        return bool(views[0].has_gate and views[0].has_platform)
