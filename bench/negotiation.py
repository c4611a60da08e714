"""Bids and messages a call: MIP, its silent form, MIP in random order, and the classic contract net, on one CAN bus.

Idle robots stand at random places of one alley; a compartment calls for a transport and they bid their finishing
time. All four protocols get the same calls and places, the same messages and the same simulated bus (bitwise
arbitration, exact frame lengths). Run from the checkout: ``python -m bench.negotiation [calls a row]``. Two tables;
nothing is written.

Counted per call, from the call to the winner's firm itinerary: bids; messages (a call, a bid, an itinerary, an award
are one message each); frames on the bus, where a call is three and an itinerary, which comes with the award, one more
than its legs. "ms to winner" is from the call to the moment at which the winner knows; "in vain" are bids that were no
better than one before them on the wire; "best" is how often the cheapest bidder, and nobody else, won.

A third table is of frames that single receivers miss: how many calls in a hundred end with two winners, with none, and
with one whom the initiator does not know, with the award and without (row P11).
"""

import asyncio
import random
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Protocol

from bench._arguments import a_count, given
from bus_sim.can.faults import FaultKind, InjectedFault
from bus_sim.can.medium import Medium
from bus_sim.can.node import NodeOptions, SimulatedBus
from bus_sim.systems.car_park.baselines.contract_net import ContractNetInitiator, ContractNetParticipant
from bus_sim.virtual_time import VirtualTimeLoop, run
from onboard.config.site import parse_site
from onboard.contract.codes import Criterion, Grade, KindCode, LegAction, Operation, Side
from onboard.contract.messages import Bid, CallForProposals, Itinerary, Leg, Message, Reference, Stamp
from onboard.core.effects import Effect, Send
from onboard.core.frame import Frame
from onboard.core.negotiation import (
    Awarded,
    AwardedAgain,
    CallKey,
    Closed,
    DelayRule,
    Negotiation,
    NegotiationEvent,
    Proposal,
    RequestedTerms,
    beats,
    slot_of,
)
from onboard.core.negotiation import delay_us as better_bids_sooner
from onboard.core.serial import from_bus_ms, to_bus_ms
from onboard.core.site import Segment, Site, Timing
from onboard.ways.kinematics import run_duration_us
from onboard.ways.site import WaySite, way_site
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder

#: Length of the alley, in positions of 2.4 m: 240 m, room for 50 robots.
POSITIONS = 100
FLEETS = (5, 10, 20, 50)
CALLS = 300
SEED = 1
INITIATOR = 1
FIRST_ROBOT = 11
#: What a controller needs to read one frame, us: the value of the first table, then those of the second.
PROCESSING_US = 100
SLOWER_US = (0, 1_000, 5_000, 20_000)
SLOWER_FLEET = 20
#: Share of frames that each receiver misses by itself, in the third table.
LOSSES = (0.0, 0.001, 0.01, 0.02, 0.05, 0.1)
LOSSY_FLEET = 10
#: From the deadline to the first motion, and the work at both ends without the way between them, us.
START_US, WORK_US = 150_000, 30_000_000

Outcome = list[Effect | NegotiationEvent]


class Party(Protocol):
    """A machine's side of a protocol, sans-IO."""

    def receive(self, message: Message, now_us: int) -> Outcome:
        """A message from the bus."""


@dataclass
class IdleRobot:
    """A task-generation function without plans: the way to the car, then the task. Implements ``Estimator``."""

    site: WaySite
    node_id: int
    position: int = 1

    def _cost(self, call: CallForProposals, distance: int, now_us: int) -> int:
        way_us = run_duration_us(distance * self.site.tracks[1].pitch_mm, self.site.carrier)
        return to_bus_ms(from_bus_ms(call.deadline_ms, now_us) + START_US + way_us + self._task_us(call))

    def _task_us(self, call: CallForProposals) -> int:
        distance = abs((call.from_station & 0x7F) - (call.to_station & 0x7F))
        return WORK_US + run_duration_us(distance * self.site.tracks[1].pitch_mm, self.site.carrier)

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """It stands in front of the car."""
        return self._cost(call, 0, now_us)

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """It stands where it stands."""
        return self._cost(call, abs(self.position - (call.from_station & 0x7F)), now_us)

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """Nobody is in the way, so the bound is the cost."""
        cost = self._cost(call, abs(self.position - (call.from_station & 0x7F)), now_us)
        return Proposal(cost, None, (), ())

    def firm(self, won: Awarded) -> Itinerary:
        """The plan that the winner announces."""
        call, cost = won.call, won.proposal.cost
        take, leave = call.from_station & 0x7F, call.to_station & 0x7F
        ends = [call.deadline_ms + 1000 * number for number in range(1, 4)]
        legs = (
            Leg(LegAction.TRAVEL, 1, self.position, take, Side.NEAR, ends[0]),
            Leg(LegAction.WORK, 1, take, take, Side.NEAR, ends[1]),
            Leg(LegAction.TRAVEL, 1, take, leave, Side.NEAR, ends[2]),
            Leg(LegAction.WORK, 1, leave, leave, Side.NEAR, cost),
        )
        return Itinerary(self.node_id, 1, Grade.FIRM, Stamp(call.deadline_ms, call.sender, call.call & 0xFF), legs)


@dataclass
class Tally:
    """What a row of the table counts."""

    calls: int = 0
    bids: int = 0
    messages: int = 0
    frames: int = 0
    best_won: int = 0
    crossed: int = 0
    latency_us: int = 0
    winners: list[int] = field(default_factory=list)
    #: By task: who acts as its winner, and whom the initiator takes for it.
    acting: dict[Reference, set[int]] = field(default_factory=dict)
    named: dict[Reference, int] = field(default_factory=dict)

    @property
    def doubled(self) -> int:
        """Calls with two winners or more."""
        return sum(len(nodes) > 1 for nodes in self.acting.values())

    @property
    def unserved(self) -> int:
        """Calls without a winner to the end."""
        return self.calls - len(self.acting)

    @property
    def misnamed(self) -> int:
        """Calls with one winner, who is not the one whom the initiator named."""
        return sum(len(nodes) == 1 and self.named.get(task) not in nodes for task, nodes in self.acting.items())


class Node:
    """One machine: a protocol's party on the simulated bus."""

    def __init__(self, loop: VirtualTimeLoop, bus: SimulatedBus, tally: Tally, party: Party) -> None:
        self.party = party
        self.robot: IdleRobot | None = None
        self.closed: Closed | None = None
        self._standing: Bid | None = None
        self._plans: dict[CallKey, Itinerary] = {}
        self._loop, self._tally = loop, tally
        self._bus = bus
        self._decoder = Decoder(fleet_codec())
        self._bus.subscribe(self._on_frame)

    def carry_out(self, outcome: Outcome, now_us: int) -> None:
        """Send what is to be sent; a winner announces its plan."""
        for item in outcome:
            match item:
                case Send(message):
                    self._say(message)
                case Awarded() if self.robot is not None:
                    self._tally.winners.append(self.robot.node_id)
                    self._tally.acting.setdefault(item.call.task, set()).add(self.robot.node_id)
                    self._tally.latency_us += now_us
                    self._plans[item.call_key] = self.robot.firm(item)
                    self._say(self._plans[item.call_key])
                case AwardedAgain(call_key=key):
                    self._say(self._plans[key])
                case Closed():
                    self.closed = item
                    self._tally.named[item.call.task] = item.winner
        self._set_timer()

    def _say(self, message: Message) -> None:
        self._tally.messages += 1
        self._tally.bids += isinstance(message, Bid)
        for frame in fleet_codec().encode(message):
            self._bus.send(frame)

    def _on_frame(self, frame: Frame, time_us: int) -> None:
        message = self._decoder.feed(frame, time_us)
        if isinstance(message, Bid) and self.robot is None:
            self._watch(message)
        if message is not None:
            self.carry_out(self.party.receive(message, time_us), time_us)

    def _watch(self, bid: Bid) -> None:
        """The caller hears every bid in the order of the wire: one that improves nothing was sent in vain."""
        if self._standing is not None and self._standing.call == bid.call:
            standing = self._standing
            if not beats(bid.cost, bid.sender, standing.cost, standing.sender, Criterion.FINISH_TIME):
                self._tally.crossed += 1
                return
        self._standing = bid

    def _set_timer(self) -> None:
        if isinstance(self.party, Negotiation | ContractNetInitiator):
            due_us = self.party.next_wake()
            if due_us is not None:
                self._loop.at_us(due_us, self._on_timer)

    def _on_timer(self, now_us: int) -> None:
        """Timers cannot be cancelled: an old one finds nothing due."""
        if isinstance(self.party, Negotiation | ContractNetInitiator):
            due_us = self.party.next_wake()
            if due_us is not None and due_us <= now_us:
                self.carry_out(self.party.wake(now_us), now_us)


class RandomOrder:
    """No better-sooner rule: each machine is ready after a random part of W, whatever its cost."""

    def __init__(self, seed: str) -> None:
        self._random = random.Random(seed)  # chance in a simulation, not a secret

    def __call__(self, cost: int, floor: int, criterion: Criterion, timing: Timing) -> int:
        """See ``DelayRule``."""
        return self._random.randrange(timing.bid_delay_us)


def mip(silent: bool = False, delay: Callable[[int], DelayRule] | None = None) -> "Maker":
    """Parties of the MIP; ``delay`` makes a machine's rule from its node-ID."""

    def make(node_id: int, robot: IdleRobot, site: Site, fleet: frozenset[int]) -> Negotiation:
        kind = KindCode.COMPARTMENT if node_id == INITIATOR else KindCode.ROBOT
        rule = delay(node_id) if delay is not None else better_bids_sooner
        slot = slot_of(site, node_id)
        return Negotiation(node_id, kind, replace(site.timing, silent=silent), robot, delay=rule, slot=slot)

    return make


def contract_net(
    node_id: int, robot: IdleRobot, site: Site, fleet: frozenset[int]
) -> ContractNetInitiator | ContractNetParticipant:
    """Parties of the classic contract net."""
    if node_id == INITIATOR:
        return ContractNetInitiator(node_id, site.timing, fleet)
    return ContractNetParticipant(node_id, KindCode.ROBOT, robot)


Maker = Callable[[int, IdleRobot, Site, frozenset[int]], Negotiation | ContractNetInitiator | ContractNetParticipant]

PROTOCOLS: dict[str, Maker] = {
    "MIP": mip(),
    "MIP, silent": mip(silent=True),
    "MIP, random order": mip(delay=lambda node_id: RandomOrder(f"{SEED} {node_id}")),
    "contract net": contract_net,
}


def alley(robots: int) -> WaySite:
    """One alley, one compartment and ``robots`` robots, with the times that a site file has by default."""
    text = f'[site]\nname = "bench"\n[floors]\ncount = 1\npositions = {POSITIONS}\n'
    text += f'[[compartments]]\nname = "IOC1"\nnode = {INITIATOR}\nat = "p(1,4)"\n'
    for number in range(robots):
        node, home = FIRST_ROBOT + number, 6 + number
        text += f'[[robots]]\nname = "MR{number + 1}"\nnode = {node}\nhome = "p(1,{home})"\n'
    return way_site(parse_site(text, "bench", crowded=True))  # they negotiate and do not drive


async def _measure(maker: Maker, site: WaySite, calls: int, seed: int, processing_us: int, loss: float = 0.0) -> Tally:
    loop = asyncio.get_running_loop()
    if not isinstance(loop, VirtualTimeLoop):
        raise TypeError("to be run in virtual time")
    tally, chance = Tally(), random.Random(seed)  # chance in a simulation, not a secret
    lost = InjectedFault(FaultKind.OMISSION, probability=loss, seed=seed)
    medium = Medium(loop, bit_rate=site.bitrate, faults=(lost,) if loss else ())
    robots = {m.node_id: IdleRobot(site, m.node_id) for m in site.machines.values() if m.kind is KindCode.ROBOT}
    fleet = frozenset(robots)
    options = NodeOptions(processing_us=processing_us)

    def join(node_id: int, robot: IdleRobot) -> Node:
        return Node(
            loop, medium.attach(f"N{node_id}", node_id, options=options), tally, maker(node_id, robot, site, fleet)
        )

    caller = join(INITIATOR, IdleRobot(site, INITIATOR))
    for node_id, robot in robots.items():
        join(node_id, robot).robot = robot
    for number in range(calls):
        places = chance.sample(range(1, POSITIONS + 1), len(robots))
        for robot, place in zip(robots.values(), places, strict=True):
            robot.position = place
        await _call(caller, robots, tally, site, number + 1, chance)
        # Over before the next: every deadline has passed, every frame has left.
        await asyncio.sleep(2 * site.timing.call_window_us / 1e6)
    if loss:
        # What was lost is said again, more and more slowly.
        await asyncio.sleep(60)
    tally.calls = calls
    tally.frames = medium.statistics().frames
    return tally


async def _call(
    caller: Node, robots: dict[int, IdleRobot], tally: Tally, site: Site, number: int, chance: random.Random
) -> None:
    loop = asyncio.get_running_loop()
    take, leave = chance.sample(range(1, POSITIONS + 1), 2)
    terms = RequestedTerms(
        Reference(INITIATOR, number),
        Operation.PARK,
        KindCode.ROBOT,
        Criterion.FINISH_TIME,
        Segment(1, take).number,
        Segment(1, leave).number,
        Reference(INITIATOR, number),
        2_500,
    )
    begin_us = round(loop.time() * 1e6)
    caller.closed, winners = None, len(tally.winners)
    assert isinstance(caller.party, Negotiation | ContractNetInitiator)
    caller.carry_out(list(caller.party.open(terms, begin_us)), begin_us)
    await asyncio.sleep(1.5 * site.timing.call_window_us / 1e6)
    distances = [(abs(robot.position - take), node) for node, robot in robots.items()]
    won = tally.winners[winners:]
    tally.best_won += won == [min(distances)[1]]
    tally.latency_us -= begin_us * len(won)


def measure(
    maker: Maker,
    robots: int,
    calls: int = CALLS,
    seed: int = SEED,
    processing_us: int = PROCESSING_US,
    loss: float = 0.0,
) -> Tally:
    """One row of the table, in virtual time; ``loss`` is the share of frames that each receiver misses."""
    return run(_measure(maker, alley(robots), calls, seed, processing_us, loss))


def _print_protocols(calls: int) -> None:
    print(
        f"{'robots':>6} {'protocol':<18} {'bids/call':>9} {'messages/call':>13} {'frames/call':>11} "
        f"{'ms to winner':>12} {'in vain':>8} {'best':>6}"
    )
    for robots in FLEETS:
        for name, maker in PROTOCOLS.items():
            tally = measure(maker, robots, calls)
            latency_ms = tally.latency_us / max(1, len(tally.winners)) / 1e3
            print(
                f"{robots:>6} {name:<18} {tally.bids / calls:>9.2f} {tally.messages / calls:>13.2f} "
                f"{tally.frames / calls:>11.2f} {latency_ms:>12.1f} {tally.crossed:>8} {tally.best_won / calls:>6.0%}"
            )


def _print_losses(calls: int) -> None:
    print(
        f"\n{LOSSY_FLEET} robots, frames missed by single receivers, calls in a hundred\n\n"
        f"{'missed':>7} {'protocol':<12} {'two winners':>11} {'none':>6} {'not the one named':>18}"
    )
    for loss in LOSSES:
        for name in ("MIP", "MIP, silent"):
            tally = measure(PROTOCOLS[name], LOSSY_FLEET, calls, loss=loss)
            double, none, misnamed = (100 * one / calls for one in (tally.doubled, tally.unserved, tally.misnamed))
            print(f"{loss:>7.1%} {name:<12} {double:>11.1f} {none:>6.1f} {misnamed:>18.1f}")


def _print_slower_boards(calls: int) -> None:
    print(
        f"\n{SLOWER_FLEET} robots, MIP, slower controllers\n\n"
        f"{'us a frame':>10} {'bids/call':>9} {'in vain':>8} {'best':>6}"
    )
    for processing_us in SLOWER_US:
        tally = measure(PROTOCOLS["MIP"], SLOWER_FLEET, calls, SEED, processing_us)
        print(f"{processing_us:>10} {tally.bids / calls:>9.2f} {tally.crossed:>8} {tally.best_won / calls:>6.0%}")


def main() -> None:
    """Print bids and messages for each protocol and fleet size; calls a row from the command line."""
    calls = given(calls=(a_count, CALLS)).calls
    timing = alley(FLEETS[0]).timing
    print(
        f"{calls} calls a row, seed {SEED}; idle robots at random among {POSITIONS} places; {PROCESSING_US} us to read "
        f"a frame; 500 kbit/s; W {timing.bid_delay_us / 1e3:g} ms, h {timing.bid_half_us / 1e6:g} s, window "
        f"{timing.call_window_us / 1e3:g} ms, slots of {slot_of(alley(5), INITIATOR).length_us / 1e3:g} ms\n"
    )
    _print_protocols(calls)
    _print_slower_boards(calls)
    _print_losses(calls)


if __name__ == "__main__":
    main()
