"""A live controller under random and mutated frames: no exception, bounded memory, every drop counted with its reason.

The corpus is what was on the buses while the site ran with customers, or with orders: its frames come again as they
were, out of order, from other senders, with bits flipped, too short, too long; between them frames of pure chance. The
controller is the real one, with its shell, journal and timers, in virtual time. A halt is no error (a forged stop, a
second node under its own node-ID); it is started again then, from its journal.
"""

import asyncio
import random
import re
import types
from collections import Counter, deque
from collections.abc import Iterator
from dataclasses import dataclass, field

from bus_sim.campaign.trial import stage_of
from bus_sim.faults.scenario import FaultScenario
from bus_sim.journal import SimulatedJournal
from bus_sim.run import EventLog, NoWatchdog, run_until
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.system import Occasion
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.contract.codes import Reason
from onboard.controller.shell import Controller, Ports
from onboard.core.frame import Frame
from onboard.core.records import next_boot
from onboard.core.site import Machine, Site
from onboard.holon.holon import Holon
from onboard.ports.bus import BusHealth, ErrorState, FrameHandler
from onboard.systems.contract import codecs_for
from onboard.systems.registry import factory_for
from onboard.wire.codec import Codecs

#: What a controller that fell over by a program error says; everything else that it halts for is a decision.
_ERROR = "Error: "
#: So much virtual time passes with each frame, us: a bus of 500 kbit/s that is full.
FRAME_US = 320
#: Entries that a journal may have before the machine gets a new one, so that a restart stays cheap.
JOURNAL_LIMIT = 2_000
#: How often a frame whose sender is drawn as the controller's own node-ID keeps it.
OWN = 0.05
#: The corpus is what was said in so long, s.
CORPUS_S = 400.0
#: Frames of the fleet bus, and of all device buses.
Corpus = tuple[list[Frame], list[Frame]]


@dataclass
class FuzzOutcome:
    """What came of it. ``reasons`` are drops as the controller counted them, ``halts`` its words, ``sizes`` by time."""

    frames: int = 0
    reasons: Counter[Reason] = field(default_factory=Counter)
    halts: Counter[str] = field(default_factory=Counter)
    errors: list[str] = field(default_factory=list)
    uncounted: list[str] = field(default_factory=list)
    sizes: list[int] = field(default_factory=list)


class _Wire:
    """A bus of which the fuzzer is the other end."""

    name = "fuzz"

    def __init__(self) -> None:
        self.handlers: list[FrameHandler] = []

    def subscribe(self, on_frame: FrameHandler, on_sent: FrameHandler | None = None) -> None:
        """Nobody asks what was sent."""
        self.handlers.append(on_frame)

    def send(self, frame: Frame) -> bool:
        """Taken, and heard by nobody."""
        return True

    def health(self) -> BusHealth:
        """Always well."""
        return BusHealth(ErrorState.ERROR_ACTIVE, 0, 0, 0, 0, 0, 0)

    async def close(self) -> None:
        """Nothing to give back."""


def record(site: Site, seed: int = 1) -> Corpus:
    """What all machines of a site are fed with, recorded while two customers come and go, or orders."""
    loop = VirtualTimeLoop()
    return run_on(loop, _record(site, seed, loop))


async def _record(site: Site, seed: int, loop: VirtualTimeLoop) -> Corpus:
    few = simulated_of(site).on(Occasion.FEW, site)
    stage = stage_of(site, FaultScenario(site.name, seed, CORPUS_S, few), loop)
    fleet: list[Frame] = []
    devices: list[Frame] = []
    stage.run.fleet.tap(lambda frame, _time_us, _sender: fleet.append(frame))
    for medium in stage.run.devices.values():
        medium.tap(lambda frame, _time_us, _sender: devices.append(frame))
    stage.run.start()
    await run_until(stage.run, lambda: stage.is_over, round(CORPUS_S * 1e6), 1_000_000)
    return fleet, devices


def _sender(chance: random.Random, avoided: int) -> int:
    """Any node-ID, but ``avoided`` only now and then: a frame under its own makes a controller stop."""
    node = chance.randrange(256)
    return node if node != avoided or chance.random() < OWN else (node + 1) % 256


def _mutations(chance: random.Random, corpus: list[Frame], avoided: int) -> Iterator[Frame]:
    """Without end: replayed, mutated and random frames."""
    position = 0
    while True:
        what = chance.random()
        position = (position + 1) % len(corpus) if chance.random() < 0.9 else chance.randrange(len(corpus))
        frame = corpus[position]
        identifier, data = frame.arbitration_id, bytearray(frame.data)
        if what < 0.35:
            pass
        elif what < 0.5:
            identifier = identifier & ~0xFF | _sender(chance, avoided)
        elif what < 0.75 and data:
            for _ in range(chance.randint(1, 4)):
                data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
        elif what < 0.8:
            identifier ^= 1 << chance.randrange(8, 29)
        elif what < 0.85:
            data = data[: chance.randrange(len(data) + 1)]
        elif what < 0.9:
            data = bytearray(chance.randbytes(len(data)))
        elif what < 0.95:
            identifier = chance.randrange(1 << 21) << 8 | _sender(chance, avoided)
            data = bytearray(chance.randbytes(chance.randint(0, 8)))
        else:
            yield Frame(chance.randrange(1 << 11), chance.randbytes(chance.randint(0, 8)), is_extended=False)
            continue
        yield Frame(identifier, bytes(data))


class Fuzzer:
    """Feeds one machine of a site; ``device_share`` of the frames come on its device bus.

    ``corpus`` is the site's recording by the same seed, where one has been made already.
    """

    def __init__(
        self, site: Site, machine: Machine, seed: int = 1, device_share: float = 0.2, corpus: Corpus | None = None
    ) -> None:
        self._site, self._machine = site, machine
        self._chance = random.Random(f"fuzz:{site.name}:{machine.name}:{seed}")
        self._share = device_share
        self._journal = SimulatedJournal()
        self._codecs: Codecs = codecs_for(site)
        fleet, devices = corpus or record(site, seed)
        # A node of its own on the bus would be heard at once; so nearly all forged frames have other senders.
        others = [frame for frame in fleet if frame.arbitration_id & 0xFF != machine.node_id]
        own = [frame for frame in devices if frame.arbitration_id & 0xFF == machine.node_id] or devices
        self._sources = (_mutations(self._chance, others, machine.node_id), _mutations(self._chance, own, 0))
        self.outcome = FuzzOutcome()

    def run(self, frames: int, looks: int = 4) -> FuzzOutcome:
        """Feed so many frames; the size of the controller's memory is noted ``looks`` times."""
        loop = VirtualTimeLoop()
        run_on(loop, self._run(frames, max(1, frames // looks), loop))
        return self.outcome

    async def _run(self, frames: int, look_every: int, loop: VirtualTimeLoop) -> None:
        controller, wires = self._start()
        for number in range(1, frames + 1):
            which = int(self._chance.random() < self._share)
            frame = next(self._sources[which])
            self._feed(controller, wires[which], which, frame, loop.now_us())
            if number % 8 == 0:
                await asyncio.sleep(8 * FRAME_US / 1e6)
            if controller.holon.halted is not None:
                self._note_halt(controller.holon.halted)
                self.outcome.reasons += controller.all_drops()
                controller, wires = self._start()
            if number % look_every == 0:
                self.outcome.sizes.append(size(controller))
        self.outcome.frames += frames
        self.outcome.reasons += controller.all_drops()
        controller.holon.halted = controller.holon.halted or "over"
        await asyncio.sleep(1)

    def _start(self) -> tuple[Controller, tuple[_Wire, _Wire]]:
        # What was forged into the journal is replayed, as after a crash; a long one is exchanged for an empty one.
        entries = self._journal.replay()
        entries = entries if len(entries) < JOURNAL_LIMIT else []
        self._journal = SimulatedJournal(entries=entries)
        self._journal.replay()
        factory = factory_for(self._site, self._machine.kind)
        holon = Holon(self._site, self._machine, factory, boot=next_boot(entries), entries=entries)
        wires = (_Wire(), _Wire())
        controller = Controller(holon, Ports(*wires, self._journal, EventLog(limit=10), NoWatchdog()), *self._codecs)
        controller.start()
        return controller, wires

    def _feed(self, controller: Controller, wire: _Wire, which: int, frame: Frame, now_us: int) -> None:
        expected = self._codecs[which].decode_part(frame)
        before = controller.wire_drops()
        idle = controller.is_idle
        for handler in wire.handlers:
            handler(frame, now_us)
        if isinstance(expected, Reason) and idle and controller.wire_drops()[expected] != before[expected] + 1:
            self.outcome.uncounted.append(f"{expected.name}: {frame}")

    def _note_halt(self, why: str) -> None:
        if _ERROR in why or "do not come to rest" in why:
            self.outcome.errors.append(why)
        self.outcome.halts[re.split("[:;]", why)[0]] += 1


def size(controller: Controller) -> int:
    """How many things the controller's tables hold: all items of all containers that are reached from it."""
    total, seen, waiting = 0, set[int](), [controller.holon, controller]
    while waiting:
        one = waiting.pop()
        if id(one) in seen:
            continue
        seen.add(id(one))
        items = _items(one)
        total += len(items)
        waiting += items
    return total


def _items(one: object) -> list[object]:
    if isinstance(
        one, str | bytes | int | float | type | types.FunctionType | types.MethodType | Site | asyncio.Future
    ):
        return []
    if isinstance(one, dict):
        return [*one.keys(), *one.values()]
    if isinstance(one, list | tuple | set | frozenset | deque):
        return list(one)
    if not type(one).__module__.startswith("onboard."):
        return []
    slots = getattr(type(one), "__slots__", ())
    return [*getattr(one, "__dict__", {}).values(), *(getattr(one, name, None) for name in slots)]
