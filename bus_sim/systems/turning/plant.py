"""The turning cell as it is: controls that run programs, edges that wear, bars and parts, the counter, the oracle."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache, partial
from math import hypot

from bus_sim.devices.link import BusDeviceLink, DeviceBusLink
from bus_sim.devices.timers import Timer, Timers
from bus_sim.devices.watched import WatchedWork
from bus_sim.systems.turning.nc import ProgramError, ProgramRun, contour_error_mm, run_program
from onboard.contract.codes import OrderResult
from onboard.contract.messages import Message
from onboard.contract.turning import LatheAction, NcMode
from onboard.contract.turning_device import JobAnswer, JobEntry, LatheOrder, NcState, ProgramEnd, ProgramText, ToolState
from onboard.systems.turning.fields import CHUNK, crc16
from onboard.systems.turning.site import BatchDemand, ContourElement, Drawing, Lathe, Turning

STATE_REPEAT_US = 2_000_000
#: A control that works and hears no order for so long stands, us (dbc/turning.dbc).
TIME_OUT_US = 2_500_000
TOOL_REPEAT_US = 10_000_000
ENTRY_REPEAT_US = 1_000_000
#: Orders begin so long after power-up, us.
ORIGIN_US = 10_000_000
#: How far a made part may be from its drawing, mm (issue 5, point 4).
TOLERANCE_MM = 0.01
#: An edge may cut so much longer than its life by rounding, min.
LIFE_SLACK_MIN = 0.01
_MINUTE_US = 60_000_000


def contour_of(drawing: Drawing) -> list[tuple[float, float]]:
    """The drawing's contour as (radius, z) points in mm, arcs by points on the arc."""
    points: list[tuple[float, float]] = []
    for element in drawing.elements:
        points += _points_of(element)
    return points


@lru_cache(maxsize=256)
def _off_drawing_mm(text: str, drawing: Drawing) -> float:
    """How far what a program cuts is from the drawing, mm; the same program is sent again and again."""
    return contour_error_mm(run_program(text), contour_of(drawing))


def _points_of(element: ContourElement) -> list[tuple[float, float]]:
    one, other = element.start, element.end
    shares = [i / 20 for i in range(21)]
    chord = [(one.r_um + (other.r_um - one.r_um) * s, one.u_um + (other.u_um - one.u_um) * s) for s in shares]
    if element.radius_um:
        centre = element.centre
        scale = [abs(element.radius_um) / hypot(r - centre.r_um, u - centre.u_um) for r, u in chord]
        moved = zip(chord, scale, strict=True)
        chord = [(centre.r_um + (r - centre.r_um) * s, centre.u_um + (u - centre.u_um) * s) for (r, u), s in moved]
    return [(r / 1000, -u / 1000) for r, u in chord]


class NcDevice:
    """Control, turret and chuck of one lathe. It makes what the loaded program says, and its edges wear."""

    def __init__(self, lathe: Lathe, plant: "TurningPlant", link: DeviceBusLink) -> None:
        self.lathe = lathe
        self.mode = NcMode.READY
        self.program = 0
        self.text = ""
        self.parts = 0
        #: Parts made since power-up, by drawing number.
        self.made: dict[int, int] = {}
        self.used_min = dict.fromkeys((tool.number for tool in lathe.tools), 0.0)
        self.edges_changed = 0
        self.busy_us = 0
        self._plant, self._link, self._timers = plant, link, plant.timers
        self._sequence = 0
        self._chunks: dict[int, bytes] = {}
        self._loading = 0
        self._run: ProgramRun | None = None
        self._set_up_for: tuple[str, int] | None = None
        self._timer: Timer | None = None
        self._work = WatchedWork(plant.timers, TIME_OUT_US, self._stand)
        #: What it was at when it came to stand.
        self._stands_in = NcMode.READY
        link.subscribe(self._on_message)
        link.answer(self._say_all)

    def start(self) -> None:
        """Power on: say how it is, and how its edges are."""
        self._say()
        self._say_tools()

    def _on_message(self, message: Message, now_us: int) -> None:
        match message:
            case ProgramText():
                if message.program != self._loading or message.index == 0:
                    self._loading, self._chunks = message.program, {}
                self._chunks[message.index] = message.text.to_bytes(CHUNK, "little")
            case ProgramEnd():
                self._on_end(message)
            case LatheOrder() if message.sequence != self._sequence and self.mode is NcMode.READY:
                self._sequence = message.sequence
                self._begin(message)
            case LatheOrder() if message.sequence == self._sequence and self._work.hear():
                self.mode = self._stands_in
                self._say()

    def _on_end(self, end: ProgramEnd) -> None:
        """A program that came whole is loaded; one that did not is asked for again by silence."""
        data = b"".join(self._chunks[index] for index in sorted(self._chunks))[: end.length]
        if end.program != self._loading or len(data) != end.length or crc16(data) != end.crc:
            return
        if self.program != end.program or self.text != data.decode("ascii"):
            self.program, self.text = end.program, data.decode("ascii")
            try:
                self._run = run_program(self.text)
            except ProgramError as error:
                self._run = None
                self._plant.note(f"{self.lathe.name} got a program that cannot be run: {error}")
            else:
                self._plant.check_program(self.lathe, self.text, self._run)
        self._say()

    def _begin(self, order: LatheOrder) -> None:
        if self._run is None:
            self._plant.note(f"{self.lathe.name} was ordered to work without a program")
            return
        change_min = self._change_edges(order.edges)
        if order.lathe_action is LatheAction.SET_UP:
            drawing = int(self.text.splitlines()[1][1:])
            mounted = (self.lathe.chucks[order.chuck].name, drawing)
            minutes = 0.0 if mounted == self._set_up_for else self.lathe.setup_min
            self._set_up_for = mounted
            self._begin_work(NcMode.SETTING, minutes + change_min, self._set)
        else:
            run = self._run
            minutes = sum(run.cut_min.values()) + run.rapid_mm / self.lathe.rapid_mm_min
            minutes += run.tool_changes * self.lathe.tool_change_min + self.lathe.load_min + self.lathe.unload_min
            self._begin_work(NcMode.RUNNING, minutes + change_min, partial(self._made, run))

    def _change_edges(self, edges: int) -> float:
        changed = [tool for tool in self.used_min if edges >> tool - 1 & 1]
        for tool in changed:
            self.used_min[tool] = 0.0
            self.edges_changed += 1
        return self.lathe.edge_change_min * len(changed)

    def _begin_work(self, mode: NcMode, minutes: float, done: Callable[[], None]) -> None:
        duration_us = round(minutes * _MINUTE_US)
        self.mode = mode
        self.busy_us += duration_us
        self._say()
        self._work.begin(duration_us, done)

    def _stand(self) -> None:
        self._stands_in, self.mode = self.mode, NcMode.HELD
        self._say()

    def _set(self) -> None:
        self.mode, self.parts = NcMode.READY, 0
        self._say()

    def _made(self, run: ProgramRun) -> None:
        for number, minutes in run.cut_min.items():
            self.used_min[number] = self.used_min.get(number, 0.0) + minutes
        for tool in self.lathe.tools:
            if self.used_min[tool.number] > tool.life_min + LIFE_SLACK_MIN:
                self._plant.note(f"{self.lathe.name}: the edge of tool {tool.number} cut longer than it lives")
        drawing = int(self.text.splitlines()[1][1:])
        self.made[drawing] = self.made.get(drawing, 0) + 1
        self.mode, self.parts = NcMode.READY, self.parts + 1
        # The wear is told before the control is ready: the next part may need new edges.
        self._say_wear()
        self._say()

    def _say(self) -> None:
        self._link.send(NcState(self.lathe.node_id, self._sequence, self.mode, self.program, self.parts % 65536))
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._timers.call_at(self._timers.now_us() + STATE_REPEAT_US, self._say)

    def _say_all(self) -> None:
        # The wear first: with the control's word the lathe takes part.
        self._say_wear()
        self._say()

    def _say_tools(self) -> None:
        self._say_wear()
        self._timers.call_at(self._timers.now_us() + TOOL_REPEAT_US, self._say_tools)

    def _say_wear(self) -> None:
        for tool, minutes in self.used_min.items():
            self._link.send(ToolState(self.lathe.node_id, tool, round(minutes * 60_000)))


@dataclass
class BatchEntry:
    """One order at the counter and what became of it."""

    number: int
    wanted: BatchDemand
    begun_us: int
    result: OrderResult | None = None
    winner: int = 0
    total_ct: int = 0
    ended_us: int | None = None


class BatchCounter:
    """The desk's counter: says each order until it is answered."""

    def __init__(self, node_id: int, plant: "TurningPlant", link: DeviceBusLink) -> None:
        self.node_id = node_id
        self.entries: list[BatchEntry] = []
        self._plant, self._link = plant, link
        link.subscribe(self._on_message)

    def add(self, wanted: BatchDemand) -> None:
        """Somebody orders a batch at this moment; said to the desk, and again until it answers."""
        entry = BatchEntry(len(self.entries) + 1, wanted, self._plant.timers.now_us())
        self.entries.append(entry)
        self._say(entry)

    def _say(self, entry: BatchEntry) -> None:
        if entry.result is not None:
            return
        job = entry.wanted.job
        numbers = job.drawing, job.material, job.batch, round(job.bar_mm), round(job.face_mm * 1000)
        self._link.send(JobEntry(self.node_id, entry.number, *numbers))
        self._plant.timers.call_at(self._plant.timers.now_us() + ENTRY_REPEAT_US, lambda: self._say(entry))

    def _on_message(self, message: Message, now_us: int) -> None:
        if not isinstance(message, JobAnswer) or not 0 < message.number <= len(self.entries):
            return
        entry = self.entries[message.number - 1]
        if entry.ended_us is not None:
            return
        entry.result, entry.winner = message.job_result, message.winner
        entry.total_ct = message.total_ct or entry.total_ct
        if message.job_result in (OrderResult.DONE, OrderResult.REFUSED):
            entry.ended_us = self._plant.timers.now_us()
            self._plant.check_end()


class TurningPlant:
    """All devices of a turning cell, and the oracle's notes in ``violations``."""

    def __init__(self, site: Turning, timers: Timers, links: dict[int, BusDeviceLink]) -> None:
        self.site = site
        self.timers = timers
        self.links = links
        self.violations: list[str] = []
        self.devices = {node: NcDevice(lathe, self, links[node]) for node, lathe in site.lathes.items()}
        self.counters = {node: BatchCounter(node, self, links[node]) for node in site.desks}
        #: Worst distance of a made contour from its drawing, mm, by drawing number.
        self.errors_mm: dict[int, float] = {}
        self.programs: dict[tuple[int, int], str] = {}
        self._to_come = len(site.orders)

    def start(self) -> None:
        """Power on, and let the demand come."""
        for device in self.devices.values():
            device.start()
        desks = list(self.counters.values())
        for number, wanted in enumerate(self.site.orders):
            self.timers.call_at(
                ORIGIN_US + wanted.at_ms * 1000, partial(self._come, desks[number % len(desks)], wanted)
            )

    def _come(self, counter: BatchCounter, wanted: BatchDemand) -> None:
        self._to_come -= 1
        counter.add(wanted)

    @property
    def entries(self) -> list[BatchEntry]:
        """All orders that came so far, counter by counter."""
        return [entry for counter in self.counters.values() for entry in counter.entries]

    @property
    def is_over(self) -> bool:
        """Whether all orders have come and each was made or refused."""
        return not self._to_come and all(entry.ended_us is not None for entry in self.entries)

    def note(self, violation: str) -> None:
        """Something that must never happen has happened."""
        self.violations.append(f"{self.timers.now_us() / 1e6:.3f} s: {violation}")

    def check_program(self, lathe: Lathe, text: str, run: ProgramRun) -> None:
        """What the program cuts is what is drawn, within the tolerance, and with tools that are there."""
        drawing = self.site.drawings.get(int(text.splitlines()[1][1:]))
        if drawing is None:
            self.note(f"{lathe.name} got a program for a drawing that does not exist")
            return
        if (lathe.node_id, drawing.number) not in self.programs or self.programs[lathe.node_id, drawing.number] != text:
            error_mm = _off_drawing_mm(text, drawing)
            self.errors_mm[drawing.number] = max(error_mm, self.errors_mm.get(drawing.number, 0.0))
            if error_mm > TOLERANCE_MM:
                self.note(f"{lathe.name}: {drawing.name} would be {error_mm:.3f} mm off its drawing")
        self.programs[lathe.node_id, drawing.number] = text
        for tool in run.cut_min:
            if tool not in self.devices[lathe.node_id].used_min:
                self.note(f"{lathe.name} has no tool {tool}")

    def check_end(self) -> None:
        """Of each drawing as many parts were made as were ordered, when all is over: none is lost, none made twice."""
        if not self.is_over:
            return
        wanted: dict[int, int] = {}
        for entry in self.entries:
            if entry.result is OrderResult.DONE:
                job = entry.wanted.job
                wanted[job.drawing] = wanted.get(job.drawing, 0) + job.batch
        for drawing in self.site.drawings:
            made = sum(device.made.get(drawing, 0) for device in self.devices.values())
            if made != wanted.get(drawing, 0):
                self.note(f"{made} parts of drawing {drawing} were made, {wanted.get(drawing, 0)} ordered")


def make_plant(site: Turning, timers: Timers, links: dict[int, BusDeviceLink], seed: int) -> TurningPlant:
    """The plant of a turning cell; nothing in it is drawn by chance."""
    return TurningPlant(site, timers, links)
