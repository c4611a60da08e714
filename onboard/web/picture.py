"""What the page shows, from decoded messages alone: a fold like the terminal's, as plain values for JSON.

Times are microseconds of the log or loop; a client draws with them and never asks for more than is in a snapshot.
"""

from collections import deque
from typing import Any

from onboard.core.codes import (
    ANY_STATION,
    OUTSIDE,
    CallResult,
    Criterion,
    KindCode,
    LegAction,
    TaskPhase,
    TokenKind,
)
from onboard.core.messages import (
    BayState,
    BusTime,
    DoorState,
    Message,
    Progress,
    Reference,
    ShuttleState,
    TokenGrant,
    TokenHeld,
    Waiting,
)
from onboard.core.serial import from_bus_ms, is_newer
from onboard.core.site import Site, Station
from onboard.trace.indicators import Indicators
from onboard.trace.view import CallRecord, SiteView

#: Calls, and lines of events, that a snapshot tells.
CALLS_SHOWN = 12
EVENTS_SHOWN = 40
#: A wait is shown as long as nothing newer is told, at most so long, us.
WAIT_SHOWN_US = 30_000_000
#: A sample of the small charts each, us, and how many are kept.
SAMPLE_US = 10_000_000
SAMPLES = 180
#: Bits of a frame of 8 bytes with a 29-bit identifier, stuff bits not counted: the load shown is what is sent at least.
FRAME_BITS = 128
_TASKS_OVER = (TaskPhase.DONE, TaskPhase.REFUSED)


class LivePicture:
    """Feed it every message of the fleet bus, and of device buses where they are heard; ask for snapshots."""

    def __init__(self, site: Site) -> None:
        self.site = site
        self.view = SiteView(site)
        self.indicators = Indicators(site)
        self._doors: dict[int, dict[str, str]] = {}
        self._bays: dict[int, dict[str, Any]] = {}
        self._shuttles: dict[int, dict[str, Any]] = {}
        self._tokens: dict[int, tuple[int, int]] = {}
        self._speeds: dict[int, tuple[int, int]] = {}
        self._waits: dict[int, tuple[int, Waiting]] = {}
        self._offset_us: int | None = None
        self._frames = 0
        self._samples: deque[list[float]] = deque(maxlen=SAMPLES)
        self._sampled_us: int | None = None
        self._frames_sampled = 0

    # --- in ----------------------------------------------------------------------------------------------------

    def count_frame(self) -> None:
        """One frame of the fleet bus, for its load."""
        self._frames += 1

    def feed(self, message: Message, time_us: int) -> None:
        """One message of the fleet bus."""
        self.view.feed(message, time_us)
        self.indicators.feed(message, time_us)
        match message:
            case BusTime():
                self._offset_us = time_us - message.bus_time_us
            case TokenGrant() if message.token_kind is TokenKind.SEGMENT:
                self._on_token(message.token, message.version, message.holder)
            case TokenHeld() if message.token_kind is TokenKind.SEGMENT:
                self._on_token(message.token, message.version, message.sender)
            case Progress():
                self._speeds[message.sender] = (message.speed_mm_s, time_us)
                if message.speed_mm_s:
                    self._waits.pop(message.sender, None)
            case Waiting():
                self._waits[message.sender] = (time_us, message)
        self._sample(time_us)

    def feed_device(self, node: int, message: Message) -> None:
        """One message of a machine's device bus."""
        match message:
            case DoorState():
                self._doors[node] = {
                    "input": message.input_door.name.lower(),
                    "output": message.output_door.name.lower(),
                    "light": message.light.name.lower(),
                }
            case BayState():
                self._bays[node] = {"car": message.load_kg > 0, "person": message.person_inside}
            case ShuttleState():
                self._shuttles[node] = {"mm": message.extension_mm, "side": int(message.side)}

    def _on_token(self, number: int, version: int, holder: int) -> None:
        known = self._tokens.get(number)
        if known is None or not is_newer(known[0], version, 16):
            self._tokens[number] = (version, holder)

    def _sample(self, time_us: int) -> None:
        if self._sampled_us is None:
            self._sampled_us = time_us
        if time_us - self._sampled_us < SAMPLE_US:
            return
        passed_s = (time_us - self._sampled_us) / 1e6
        load = (self._frames - self._frames_sampled) * FRAME_BITS / self.site.bitrate / passed_s
        waiting = sum(task.phase not in _TASKS_OVER for task in self.view.tasks.values())
        self._samples.append([time_us / 1e6, round(load, 5), waiting, self.view.parked, self.view.fetched])
        self._sampled_us, self._frames_sampled = time_us, self._frames

    # --- out ---------------------------------------------------------------------------------------------------

    def layout(self) -> dict[str, Any]:
        """What never changes: tracks, places and machines of the site."""
        site = self.site
        return {
            "site": site.name,
            "system": site.system,
            "bitrate": site.bitrate,
            "carrier_mm": site.carrier_length_mm,
            "tracks": [
                {
                    "number": track.number,
                    "kind": track.kind.value,
                    "length": track.length,
                    "pitch_mm": track.pitch_mm,
                    "joins": [[join.track, join.index] for join in track.joins],
                }
                for track in site.tracks.values()
            ],
            "places": [place.number for place in site.places],
            "machines": [
                {
                    "node": machine.node_id,
                    "name": machine.name,
                    "kind": machine.kind.name.lower(),
                    "home": [machine.home.track, machine.home.index],
                    "station": machine.station.number if machine.station is not None else None,
                }
                for machine in site.machines.values()
            ],
        }

    def snapshot(self) -> dict[str, Any]:
        """Everything that changes, as it is now."""
        view = self.view
        return {
            "now_us": view.now_us,
            "machines": {node: self._machine(node) for node in self.site.machines},
            "cars": {station: _car(car) for station, car in view.places_taken().items()},
            "calls": [self.call(record) for record in list(view.calls.values())[-CALLS_SHOWN:]],
            "tasks": self._open_tasks(),
            "events": [[time_us, text] for time_us, text in list(view.events)[-EVENTS_SHOWN:]],
            "figures": {"parked": view.parked, "fetched": view.fetched, "calls": view.calls_opened, "bids": view.bids},
            "chart": list(self._samples),
        }

    def figures(self) -> dict[str, Any]:
        """The indicators up to now; dearer than a snapshot."""
        return self.indicators.figures(self.view.now_us).to_json()

    def _machine(self, node: int) -> dict[str, Any]:
        view = self.view
        segment, offset_mm = view.positions[node]
        speed_mm_s, since_us = self._speeds.get(node, (0, 0))
        state = view.states.get(node)
        aboard = view.aboard.get(node)
        told: dict[str, Any] = {
            "track": segment.track,
            "index": segment.index,
            "offset_mm": offset_mm,
            "speed_mm_s": speed_mm_s,
            "since_us": since_us,
            "state": state.name.lower() if state is not None else "silent",
            "car": _car(aboard) if aboard is not None else None,
            "plan": self._plan(node),
            "holds": self._held(node),
        }
        wait = self._waits.get(node)
        if wait is not None and view.now_us - wait[0] <= WAIT_SHOWN_US:
            told["wait"] = {
                "at": [wait[1].track, wait[1].index],
                "for": view.name(wait[1].blocker) if wait[1].blocker else None,
                "why": wait[1].reason.name.lower().replace("_", " "),
                "since_us": wait[0],
            }
        for name, known in (("doors", self._doors), ("bay", self._bays), ("shuttle", self._shuttles)):
            if node in known:
                told[name] = known[node]
        return told

    def _plan(self, node: int) -> list[list[int]]:
        """What is left of a firm itinerary: [track, from, to, begin us, end us, is a ride or work] a leg."""
        plan = self.view.itineraries.get(node)
        if plan is None or self._offset_us is None:
            return []
        legs, begin_us = [], self._log_us(plan.stamp.award_ms)
        for leg in plan.legs:
            end_us = self._log_us(leg.end_ms)
            if end_us > self.view.now_us and leg.action is not LegAction.STAND:
                legs.append([leg.track, leg.from_index, leg.to_index, begin_us, end_us, int(leg.action)])
            begin_us = end_us
        return legs

    def _held(self, node: int) -> list[list[int]]:
        machine = self.site.machines[node]
        if machine.kind is not KindCode.ROBOT:
            return []
        return sorted([number >> 8, number & 0xFF] for number, (_, holder) in self._tokens.items() if holder == node)

    def call(self, record: CallRecord) -> dict[str, Any]:
        """One call with its bids; times in us of the log."""
        call, view = record.call, self.view
        return {
            "id": f"{call.sender}.{call.call}",
            "by": view.name(call.sender),
            "what": call.operation.name.lower().replace("_", " "),
            "task": f"{call.task.origin}.{call.task.number}",
            "car": _car(call.car) if call.car.number else None,
            "from": self._place(call.from_station),
            "to": self._place(call.to_station),
            "opened_us": record.opened_us,
            "deadline_us": self._log_us(call.deadline_ms) if self._offset_us is not None else None,
            "attempt": call.attempt,
            "bids": [
                {"by": view.name(node), "at_us": at_us, "cost": self._cost(call.criterion, cost)}
                for at_us, node, cost in record.bids
            ],
            "winner": view.name(record.winner) if record.winner else None,
            "result": record.result.name.lower() if record.result is not None else None,
            "won": record.result is CallResult.AWARDED,
        }

    def _cost(self, criterion: Criterion, cost: int) -> dict[str, Any]:
        """A bid's number in its unit: a finishing time becomes a time of the log."""
        if criterion is Criterion.FINISH_TIME and self._offset_us is not None:
            return {"end_us": self._log_us(cost)}
        return {"number": cost, "unit": "ct" if criterion is Criterion.MONEY else "mm"}

    def _open_tasks(self) -> list[dict[str, Any]]:
        """Customers that wait: tasks that are not over, oldest first."""
        view = self.view
        return [
            {
                "task": f"{reference.origin}.{reference.number}",
                "at": view.name(reference.origin),
                "what": task.operation.name.lower(),
                "phase": task.phase.name.lower(),
                "owner": view.name(task.owner) if task.owner else None,
                "since_us": task.phase_us.get(TaskPhase.OPEN, view.now_us),
                "promised_us": self._log_us(task.promised_ms)
                if task.promised_ms is not None and self._offset_us is not None
                else None,
            }
            for reference, task in view.tasks.items()
            if task.phase not in _TASKS_OVER
        ]

    def _place(self, number: int) -> str:
        if number == ANY_STATION:
            return "any place"
        if number == OUTSIDE:
            return "outside"
        for node, station in self.site.compartments.items():
            if station.number == number:
                return self.view.name(node)
        return str(Station.from_number(number))

    def _log_us(self, bus_ms: int) -> int:
        """The time of the log nearest to now at which bus time reads ``bus_ms``."""
        assert self._offset_us is not None
        return from_bus_ms(bus_ms, self.view.now_us - self._offset_us) + self._offset_us


def _car(car: Reference) -> str:
    """A car as its ticket names it: who named it, and the number there."""
    return f"{car.origin}.{car.number}"
