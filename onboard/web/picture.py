"""What the page shows, from decoded messages alone: a view like the terminal's, as plain values for JSON.

Times are microseconds of the log or loop; a client draws with them and never asks for more than is in a snapshot.
What is drawn of a system, and its words, are its scene's (``onboard.trace.scene``).
"""

from collections import deque
from typing import Any

from onboard.contract.codes import CallResult, Criterion, Reason, TaskPhase
from onboard.contract.messages import Message
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.history.calls import CallHistory
from onboard.history.history import Fact
from onboard.history.lives import SILENT_BEATS
from onboard.seal.keys import Keys
from onboard.seal.marks import SealMark, SealMarks
from onboard.trace.frame_bits import frame_bits
from onboard.trace.indicators import Indicators
from onboard.trace.scene.scenes import scene_of
from onboard.trace.view import SiteView
from onboard.ways.site import way_site
from onboard.wire.codec import Codecs

#: Calls, and lines of events, that a snapshot tells.
CALLS_SHOWN = 12
EVENTS_SHOWN = 40
#: A wait is shown as long as nothing newer is told, at most so long, us.
WAIT_SHOWN_US = 30_000_000
#: A sample of the small charts each, us, and how many are kept: half an hour.
SAMPLE_US = 10_000_000
SAMPLES = 180


class LivePicture:
    """Feed it every message of the fleet bus, and of device buses where they are heard; ask for snapshots."""

    def __init__(self, site: Site, marks: SealMarks | None = None) -> None:
        """``marks``: what tells which frames are sealed, where the site has seals."""
        self.site = site
        self._marks = marks
        self.view = SiteView(site)
        self.history = self.view.history
        self.scene = scene_of(site, self.view)
        #: Whether machines move along tracks here: the indicators of robots and lifts are of such a site.
        self.has_tracks = bool(way_site(site).tracks)
        self.indicators = Indicators(site, history=self.history)
        self._clock = self.history.clock
        self._lives = self.history.lives
        self._bits = 0
        self._frames = 0
        self._samples: deque[list[float]] = deque(maxlen=SAMPLES)
        self._sampled_us: int | None = None
        self._bits_sampled = 0

    # --- in ----------------------------------------------------------------------------------------------------

    def count_frame(self, frame: Frame | None = None) -> None:
        """One frame of the fleet bus, of any sender, for the load: stuff bits and gaps between frames are in it.

        Without it, for who asks for no load, it is counted only.
        """
        self._frames += 1
        if frame is not None:
            self._bits += frame_bits(frame)

    def mark_frame(self, frame: Frame, time_us: int) -> None:
        """One frame of the fleet bus, for the counts of what is sealed."""
        if self._marks is not None:
            self._marks.hear(frame, time_us)

    def feed(self, message: Message, time_us: int) -> None:
        """One message of the fleet bus."""
        self.take(message, self.history.feed(message, time_us), time_us)

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """One message of the fleet bus that the history was fed with, and what it made of it."""
        self.view.take(message, fact, time_us)
        self.scene.take(message, fact, time_us)
        self.indicators.take(message, fact, time_us)
        self._sample(time_us)

    def feed_device(self, node: int, message: Message, time_us: int) -> None:
        """One message of a machine's device bus."""
        self.scene.feed_device(node, message, time_us)

    def _sample(self, time_us: int) -> None:
        if self._sampled_us is None:
            self._sampled_us = time_us
        if time_us - self._sampled_us < SAMPLE_US:
            return
        view, passed_s = self.view, (time_us - self._sampled_us) / 1e6
        load = (self._bits - self._bits_sampled) / self.site.bitrate / passed_s
        waiting = sum(task.is_waiting for task in view.tasks.values())
        ends = [view.parked, view.fetched] if self.has_tracks else [view.done]
        self._samples.append([time_us / 1e6, round(load, 5), waiting, *ends])
        self._sampled_us, self._bits_sampled = time_us, self._bits

    # --- out ---------------------------------------------------------------------------------------------------

    def layout(self) -> dict[str, Any]:
        """What never changes: the drawing and the machines of the site. ``series`` names the charts' columns."""
        site = self.site
        return {
            "site": site.name,
            "system": site.system,
            "bitrate": site.bitrate,
            "noun": self.view.words.noun,
            **self.scene.layout(),
            "series": ["bus load", "open tasks", *(["parked", "fetched"] if self.has_tracks else ["done"])],
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
        ends = {"parked": view.parked, "fetched": view.fetched} if self.has_tracks else {"done": view.done}
        return {
            "now_us": view.now_us,
            "machines": {node: self._machine(node) for node in self.site.machines},
            **self.scene.marks(view.now_us),
            "calls": [self.call(record) for record in list(view.calls.values())[-CALLS_SHOWN:]],
            "tasks": self._open_tasks(),
            "events": [[time_us, text] for time_us, text in list(view.events)[-EVENTS_SHOWN:]],
            "figures": {**ends, "calls": view.calls_opened, "bids": view.bids},
            "chart": list(self._samples),
        }

    def figures(self) -> dict[str, Any]:
        """The indicators up to now; dearer than a snapshot. Of other systems: mean times and messages a task."""
        view = self.view
        if self.has_tracks:
            return self.indicators.figures(view.now_us).to_json()
        mean_s = view.done_us / view.done / 1e6 if view.done else None
        return {"mean_time_s": mean_s, "messages_per_task": self._frames / view.done if view.done else None}

    def _machine(self, node: int) -> dict[str, Any]:
        view = self.view
        told = {"state": self._state(node), **self.scene.machine(node, view.now_us)}
        wait = self._lives.waits.get(node)
        if wait is not None and view.now_us - wait[0] <= WAIT_SHOWN_US:
            told["wait"] = {
                "at": [wait[1].track, wait[1].index],
                "for": view.name(wait[1].blocker) if wait[1].blocker else None,
                "why": view.words.reason(wait[1].reason),
                "since_us": wait[0],
            }
        level = self.history.batteries.levels.get(node)
        if level is not None:
            told["battery"] = {
                "percent": level.charge_permille / 10,
                "charging": level.charging,
                "bids": level.bids,
            }
        if self._marks is not None:
            counts = self._marks.counts
            told["seals"] = {mark.value: counts[node, mark] for mark in SealMark if counts[node, mark]}
        return told

    def _state(self, node: int) -> str:
        """What its last heartbeat said, unless that is too long ago."""
        heard_us = self._lives.beats_us.get(node)
        if heard_us is None or self.view.now_us - heard_us > SILENT_BEATS * self.site.timing.heartbeat_us:
            return "silent"
        return self._lives.states[node].name.lower()

    def call(self, record: CallHistory) -> dict[str, Any]:
        """One call with its bids; times in us of the log."""
        call, view, end = record.terms, self.view, record.end
        return {
            "id": f"{call.sender}.{call.call}",
            "by": view.name(call.sender),
            "what": view.words.operation(call.operation),
            "task": view.words.reference(call.task),
            "car": view.words.load(call.car) if call.car.number else None,
            "thing": view.words.thing(call.car) if call.car.number else None,
            "from": view.words.place(call.from_station),
            "to": view.words.place(call.to_station),
            "opened_us": record.opened_us,
            "deadline_us": self._clock.log_us(call.deadline_ms, view.now_us),
            "attempt": call.attempt,
            "bids": [
                {"by": view.name(node), "at_us": at_us, "cost": self._cost(call.criterion, cost)}
                for at_us, node, cost in record.bids
            ],
            "winner": view.name(end.winner) if end is not None and end.winner else None,
            "result": end.result.name.lower() if end is not None else None,
            "won": end is not None and end.result is CallResult.AWARDED,
            **({"reason": view.words.reason(end.reason)} if end is not None and end.reason is not Reason.NONE else {}),
        }

    def _cost(self, criterion: Criterion, cost: int) -> dict[str, Any]:
        """A bid's number in its unit: a finishing time becomes a time of the log."""
        end_us = self._clock.log_us(cost, self.view.now_us) if criterion is Criterion.FINISH_TIME else None
        if end_us is not None:
            return {"end_us": end_us}
        return {"number": cost, "unit": "ct" if criterion is Criterion.MONEY else "mm"}

    def _open_tasks(self) -> list[dict[str, Any]]:
        """Customers that wait: tasks that are not over, oldest first."""
        view = self.view
        return [
            {
                "task": view.words.reference(reference),
                "at": view.name(reference.origin),
                "what": view.words.operation(task.operation),
                "phase": task.phase.name.lower(),
                "owner": view.name(task.owner) if task.owner else None,
                "since_us": task.phase_us.get(TaskPhase.OPEN, view.now_us),
                "promised_us": self._clock.log_us(task.promised_ms, view.now_us)
                if task.promised_ms is not None
                else None,
            }
            for reference, task in view.tasks.items()
            if task.is_waiting
        ]


def marks_of(site: Site, codecs: Codecs, keys: Keys | None) -> SealMarks | None:
    """What tells the seals of a site's bus apart, by any node's keys or by none; None where the site has no seals."""
    if site.seals == "off":
        return None
    nodes = site.machines if keys is None else (*keys.pairs, keys.node)
    return SealMarks(nodes, codecs.fleet.decode_part, None if keys is None else keys.group)
