"""How much the machines of a site may put on the fleet bus, message by message: what response-time bounds start from.

Most messages are sent on events, so their bounds need a stated most. Each row below says how many frames may be queued
at once and after which time as many again, and why; ``excess`` tells whether a bus kept to that. What has a budget is
held to it by its sender, whatever its program wants to say (``onboard/wire/pace.py``); what answers is bounded by what
it answers. Two rows of life:
``operation`` (all machines run, nobody asks anybody to say everything again) and ``power_up`` (all start together).
Gateways, whose orders a person gives, and lost frames, which are sent again, are not counted.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

from onboard.contract.codes import KindCode, Reason
from onboard.core.site import Site
from onboard.systems.car_park.site import RideCalls, car_park
from onboard.trace.frame_length import longest_frame_bits
from onboard.trace.response import ANYBODY, Stream
from onboard.ways.site import way_site
from onboard.wire.dbc_file import MessageLayout, fleet_layouts
from onboard.wire.pace import HELD_US, Pace, paces_of

_SECOND_US = 1_000_000
#: Legs that an itinerary's head can announce (dbc/fleet.dbc).
MOST_LEGS = 31
#: What a machine says after its plans, where these wait (``onboard/controller/outgoing.py``).
_AFTER_PLANS = (
    *("ItineraryHead", "ItineraryLeg", "TokenRequest", "Waiting", "TaskReport", "CarAt"),
    *("Blocked", "Clear", "SyncRequest", "SyncDone", "Heartbeat", "Diagnostic"),
)
#: A robot asks for the segments that it covers while it brakes and in this time (kinds/car_park/travel.py), us.
_LOOKAHEAD_US = 3_000_000
#: Segments that it asks for beyond those (travel.py): in one frame, but they may be refused and granted one by one.
_MORE_AHEAD = 4
#: Beside segments ahead: a lift's platform and gate. A car and a place are asked for where no way is ahead.
_OTHER_RIGHTS = 2
#: Rides that one bid may ask for: a part's number has 4 bits (dbc/fleet.dbc).
_MOST_PARTS = 15
#: A timer may be late by a journal write and what is decided before it, us.
_TIMER_JITTER_US = 100_000

_ALL = (KindCode.ROBOT, KindCode.LIFT, KindCode.COMPARTMENT)
_ROBOT = (KindCode.ROBOT,)
_LIFT = (KindCode.LIFT,)
_COMPARTMENT = (KindCode.COMPARTMENT,)
_STEWARDS = (KindCode.COMPARTMENT, KindCode.LIFT)


class Numbers(NamedTuple):
    """What bursts and periods are made of: machines by kind, rights that a robot asks for at once, times in us.

    ``rides`` are those that all robots may call for within one call window; ``segment_us`` is the shortest segment at
    top speed.
    """

    nodes: int
    robots: int
    compartments: int
    rights: int
    rides: int
    segment_us: int
    grip_us: int
    heartbeat_us: int
    bus_time_us: int
    call_window_us: int
    paces: Mapping[str, Pace]


@dataclass(frozen=True, slots=True)
class TrafficBound:
    """At most ``burst`` frames of ``message`` at once from each machine of ``kinds``, or from all together (``()``)."""

    message: str
    kinds: tuple[KindCode, ...]
    burst: Callable[[Numbers], int]
    period_us: Callable[[Numbers], int]
    why: str
    jitter_us: Callable[[Numbers], int] = lambda _: 0


def _one(_: Numbers) -> int:
    return 1


def _two(_: Numbers) -> int:
    return 2


def _three(_: Numbers) -> int:
    return 3


def _second(_: Numbers) -> int:
    return _SECOND_US


def _window(numbers: Numbers) -> int:
    return numbers.call_window_us


def _rides(numbers: Numbers) -> int:
    return numbers.rides


def _late(_: Numbers) -> int:
    return _TIMER_JITTER_US


def _grip(numbers: Numbers) -> int:
    return max(_SECOND_US, numbers.grip_us)


def _paced(message: str, kinds: tuple[KindCode, ...], why: str) -> TrafficBound:
    """Its sender keeps to its budget."""
    return TrafficBound(
        message,
        kinds,
        _one,
        lambda n: n.paces[message].apart_us,
        why,
        lambda n: (n.paces[message].burst - 1) * n.paces[message].apart_us,
    )


def _answers(message: str, times: int, why: str) -> TrafficBound:
    """So many for each request, by whoever is asked."""

    def apart_us(numbers: Numbers) -> int:
        return numbers.paces["TokenRequest"].apart_us // (times * numbers.robots)

    def ahead_us(numbers: Numbers) -> int:
        return (times * numbers.robots * numbers.paces["TokenRequest"].burst - 1) * apart_us(numbers)

    return TrafficBound(message, (), _one, apart_us, why, ahead_us)


_OPERATION = (
    TrafficBound("EmergencyStop", _ALL, _one, _second, "a person presses a button"),
    _paced("TokenRequest", _ROBOT, "its budget; rights are asked for ahead of the way, and again"),
    _answers("TokenRefusal", 1, "the holder answers each request"),
    _answers("TokenGrant", 2, "a right that was asked for comes, and goes to the next or back"),
    _answers("TokenHeld", 2, "one for each grant"),
    TrafficBound("BusTime", (), _one, lambda n: n.bus_time_us, "its period; one machine sends it", _late),
    _paced("Heartbeat", _ALL, "its budget; its period, and after its own words"),
    _paced("Diagnostic", _ALL, "its budget; with a heartbeat, for each reason that grew"),
    *(
        row
        for part in ("Call", "CallTerms", "CallLoad")
        for row in (
            TrafficBound(part, _COMPARTMENT, _one, _window, "a desk has one call open at a time"),
            TrafficBound(part, (), _rides, _window, "rides that bidders ask for first"),
        )
    ),
    TrafficBound("CallParent", _COMPARTMENT, _one, _window, "with a call that says when the bay is ready"),
    TrafficBound("CallParent", (), _rides, _window, "with each ride's call"),
    TrafficBound("Award", _COMPARTMENT, _two, _window, "one for each call, said again once"),
    TrafficBound("Award", (), lambda n: 2 * _rides(n), _window, "one for each ride asked for, said again once"),
    TrafficBound("ManualOrder", (), _one, _second, "a person holds one machine at a time; said again until it answers"),
    TrafficBound("ManualState", (), _two, _second, "it answers, and comes to rest"),
    TrafficBound("Bid", _ROBOT, lambda n: n.compartments, _window, "one for each desk's call"),
    TrafficBound("Bid", (), _rides, _window, "one for each ride asked for"),
    _paced("ItineraryHead", _ROBOT, "its budget; with an award, a delay, and a bid where offers are told"),
    _paced("ItineraryLeg", _ROBOT, "its budget; of all itineraries together"),
    TrafficBound(
        "Progress",
        _ROBOT,
        _three,
        lambda n: max(_SECOND_US // 2, n.segment_us),
        "a segment at top speed; it stops, is at its place, and the next leg begins",
    ),
    TrafficBound("Progress", _LIFT, _three, lambda _: _SECOND_US // 2, "a floor; it stops, and the next leg begins"),
    TrafficBound("Blocked", _STEWARDS, _one, _second, "a person says so, and the track's steward says it again, once"),
    TrafficBound("Clear", _STEWARDS, _one, _second, "the same"),
    TrafficBound("Waiting", _ROBOT, _two, _grip, "once for each thing waited for"),
    TrafficBound("TaskReport", _ROBOT, _two, _grip, "one phase ends and the next begins"),
    TrafficBound("TaskReport", (), _rides, _window, "one for each ride won"),
    TrafficBound("TaskReport", _COMPARTMENT, _two, _grip, "as a robot"),
    TrafficBound("CarAt", _ALL, _two, _grip, "a car changes hands, in no less than a grip"),
)

#: Beside those where customers are promised when their cars come.
_PROMISED = (
    TrafficBound("Promise", _COMPARTMENT, _two, _second, "a ticket goes in, and one that was read elsewhere is won"),
)
#: Beside those where robots run on batteries.
_POWERED = (
    TrafficBound("BatteryLevel", _ROBOT, _two, _second, "another hundredth, and charging or bidding begins or ends"),
)

#: Every machine asks all once, and who was not answered; it says all it has once to all who ask within a quarter of a
#: second, and once to who asks late (``onboard/holon/witness.py``). Nobody holds cars or has plans yet.
_POWER_UP = (
    TrafficBound("SyncRequest", _ALL, _two, lambda n: 5 * n.heartbeat_us, "to all, and to who has not answered"),
    TrafficBound("SyncDone", _ALL, _two, lambda n: 5 * n.heartbeat_us, "after all that is said to those who ask"),
    TrafficBound("TokenHeld", _ALL, _two, lambda n: 5 * n.heartbeat_us, "to those who ask"),
    TrafficBound("ItineraryHead", _ROBOT, _three, lambda n: 5 * n.heartbeat_us, "at the start, and to those who ask"),
    TrafficBound("ItineraryLeg", _ROBOT, _three, lambda n: 5 * n.heartbeat_us, "an idle robot's one leg"),
    TrafficBound("Progress", (KindCode.ROBOT, KindCode.LIFT), _three, lambda n: 5 * n.heartbeat_us, "the same"),
    TrafficBound(
        "BusTime", (), lambda n: 3 * n.nodes, lambda n: 5 * n.heartbeat_us, "to each that asks, by two for a moment"
    ),
    _paced("Heartbeat", _ALL, "at once, when bus time is heard and when it has started, then as in operation"),
    _paced("Diagnostic", _ALL, "as in operation"),
)


def numbers_of(site: Site) -> Numbers:
    """A site's numbers; the lookahead is that of the shortest segments."""
    ways = way_site(site)
    kinds = [machine.kind for machine in site.machines.values()]
    asks = car_park(site).rides is RideCalls.BEFORE
    carrier = ways.carrier
    braking_mm = carrier.speed_mm_s**2 // (2 * carrier.acceleration_mm_s2)
    ahead_mm = braking_mm + carrier.speed_mm_s * _LOOKAHEAD_US // _SECOND_US
    paces = paces_of(site)
    shortest_mm = min(track.pitch_mm for number, track in ways.tracks.items() if number not in ways.lifts)
    return Numbers(
        len(kinds),
        kinds.count(KindCode.ROBOT),
        kinds.count(KindCode.COMPARTMENT),
        2 + -(-ahead_mm // shortest_mm) + _MORE_AHEAD + _OTHER_RIGHTS,
        _MOST_PARTS * kinds.count(KindCode.ROBOT) * kinds.count(KindCode.COMPARTMENT) if asks else 0,
        shortest_mm * _SECOND_US // carrier.speed_mm_s,
        car_park(site).timing.grip_us,
        site.timing.heartbeat_us,
        site.timing.bus_time_us,
        site.timing.call_window_us,
        paces,
    )


def operation(site: Site) -> list[Stream]:
    """Everything that may be queued while a site runs."""
    park = car_park(site)
    asked = (*(_PROMISED if park.promises else ()), *(_POWERED if park.battery is not None else ()))
    return list(_streams(site, (*_OPERATION, *asked)))


def power_up(site: Site) -> list[Stream]:
    """Everything that may be queued when all machines of a site start together."""
    return list(_streams(site, _POWER_UP))


def waits(site: Site) -> dict[str, int]:
    """How long a frame may wait for its sender's budgets at most, us by message; those that are not here never wait.

    Of itineraries there is at most one of which others have heard the beginning, and one after it.
    """
    numbers, paces = numbers_of(site), paces_of(site)
    plans_us = 2 * (MOST_LEGS * paces["ItineraryLeg"].apart_us + paces["ItineraryHead"].apart_us)
    found = dict.fromkeys(_AFTER_PLANS, plans_us)
    found["TokenRequest"] += numbers.rights * paces["TokenRequest"].apart_us
    found["Diagnostic"] += len(Reason) * paces["Diagnostic"].apart_us
    found["Heartbeat"] = HELD_US + paces["Heartbeat"].apart_us
    return found


def reasons() -> Iterator[tuple[str, str]]:
    """Message and reason of each row of operation, for documents."""
    return ((row.message, row.why) for row in _OPERATION)


def _streams(site: Site, rows: Iterable[TrafficBound]) -> Iterator[Stream]:
    layouts = {layout.name: layout for layout in fleet_layouts(site.system)}
    numbers = numbers_of(site)
    for row in rows:
        if not row.burst(numbers):
            continue
        senders = [m.node_id for m in site.machines.values() if m.kind in row.kinds] if row.kinds else [ANYBODY]
        for node in senders:
            yield _stream(row, node, layouts[row.message], numbers)


def _stream(row: TrafficBound, node: int, layout: MessageLayout, numbers: Numbers) -> Stream:
    # Whoever it is that sends, no node-ID makes the frame longer than the longest.
    ids = range(1, 256) if node == ANYBODY else (node,)
    bits = max(longest_frame_bits(layout.frame_id | one, layout.length) for one in ids)
    burst, period_us, jitter_us = row.burst(numbers), row.period_us(numbers), row.jitter_us(numbers)
    return Stream(node, layout.name, layout.frame_id | node, bits, period_us, burst, jitter_us)


def excess(streams: Iterable[Stream], queued: Iterable[tuple[int, int, str]]) -> list[str]:
    """Where a bus was asked for more than its streams allow: one line for each stream; none is as it should be.

    ``queued``: time in us, node-ID and message of each frame as it was queued, in order of time. Frames of
    messages that no stream is for are told, too.
    """
    by_node = {(stream.node, stream.name): stream for stream in streams}
    times: dict[tuple[int, str], list[int]] = {}
    for time_us, node, name in queued:
        key = (node, name) if (node, name) in by_node else (ANYBODY, name)
        times.setdefault(key, []).append(time_us)
    found = []
    for key, seen in sorted(times.items()):
        stream = by_node.get(key)
        line = f"no stream for {key[1]}" if stream is None else _too_many(stream, seen)
        if line:
            found.append(line)
    return found


def _too_many(stream: Stream, times: list[int]) -> str:
    """A bucket that holds as many bursts as may come at once, and is filled by one each period."""
    for last, until_us in enumerate(times):
        for first in range(last, -1, -1):
            span_us = until_us - times[first] + 1
            allowed = stream.burst * -(-(span_us + stream.jitter_us) // stream.period_us)
            if last - first + 1 > allowed:
                at = f"{last - first + 1} frames within {span_us} us up to {until_us / 1e6:.6f} s"
                return f"{stream.name} of node {stream.node}: {at}, at most {allowed} expected"
            if span_us > 10 * stream.period_us + stream.jitter_us:
                break
    return ""
