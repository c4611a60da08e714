"""The asyncio shell around one holon: frames and timers in, effects out. Dull on purpose.

Everything of one machine happens in one order: events wait in a bounded inbox while a journal write is under way, and
effects are carried out one after the other, so nothing is said before what must be durable is durable.
"""

import asyncio
from collections import Counter, deque
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ParamSpec

from onboard.contract.codes import MachineState, Reason
from onboard.controller.outgoing import Outgoing
from onboard.controller.rest import Rest
from onboard.core.effects import Actuate, Effect, Halt, Record, Renew, Report, Send, Tell
from onboard.core.frame import Frame
from onboard.holon.holon import Holon
from onboard.ports.bus import Bus, ErrorState
from onboard.ports.ending import NeedsPerson, needs_person
from onboard.ports.journal import Compaction, Journal
from onboard.ports.telemetry import Telemetry
from onboard.ports.watchdog import Watchdog
from onboard.wire.codec import Codec
from onboard.wire.decoder import Decoder
from onboard.wire.pace import paces_of
from onboard.wire.runs import in_runs

_Given = ParamSpec("_Given")

#: Most frames that wait for one machine; beyond that the oldest bus in the world is too fast for it.
INBOX_LIMIT = 4096
#: What the interface had no room for is tried again after this, us: some 70 frames at 500 kbit/s. Where it has taken
#: none for so long, nobody is there who acknowledges, and all is given up.
ROOM_US, NO_ROOM_US = 20_000, 1_000_000


@dataclass(frozen=True, slots=True)
class Ports:
    """What the shell is plugged into."""

    fleet_bus: Bus
    device_bus: Bus
    journal: Journal
    telemetry: Telemetry
    watchdog: Watchdog
    #: What the journal may leave out when it has grown; None: nothing ever.
    fewer: Compaction | None = None


class Controller:
    """Runs one holon on a running asyncio loop. ``start`` once, ``stop`` once."""

    def __init__(self, holon: Holon, ports: Ports, fleet: Codec, device: Codec) -> None:
        self.holon = holon
        self.ports = ports
        self._fewer = ports.fewer
        self._queue_drops: Counter[Reason] = Counter()
        self.stopped: asyncio.Future[str] | None = None
        #: For how long the processor was taken, in loop us, by what was decided since this was asked last; None on a
        #: board, where that time passes by itself.
        self.taken_us: Callable[[], int] | None = None
        #: Why it has halted; None while it has not, or where the journal could not be written.
        self.halted_for: Reason | None = None
        #: Who brings it back then; the life of a process knows of the lives before.
        self.needs_person: NeedsPerson = needs_person
        self._codecs = (fleet, device)
        holon.listen(fleet.speakers)
        self._decoders = (Decoder(fleet), Decoder(device))
        self._feed = self._decoders[0].feed
        holon.wire_drops = (*(one.drops for one in self._decoders), self._queue_drops)
        self._inbox: deque[tuple[Callable[[Frame, int], list[Effect]], Frame, int]] = deque()
        self._outbox: deque[Effect] = deque()
        self._writing: asyncio.Task[None] | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._timer_us: int | None = None
        #: What is said on the fleet bus, and what waits for its budget.
        self.outgoing = Outgoing(fleet, paces_of(holon.site), self._put_on_bus)
        self.outgoing.renewed = lambda beat: replace(beat, mirror_digest=holon.mirror.digest())
        holon.witness.is_telling = lambda: self.outgoing.is_telling
        self._saying: asyncio.TimerHandle | None = None
        #: What the interface had no room for: who keeps hundreds of cars says more in one answer than it holds.
        self._unsent: deque[Frame] = deque()
        #: Whether its wakes come to rest; a run in simulated time ends with a machine whose wakes do not.
        self.rest = Rest()
        #: Frames that the fleet bus had taken of me when it last had taken another, and when that was, us.
        self._taken = (0, 0)

    def start(self) -> None:
        """Join both buses and let the holon begin. To be called on the running loop."""
        self._loop = asyncio.get_running_loop()
        self.stopped = self._loop.create_future()
        self.ports.fleet_bus.subscribe(self._on_fleet_frame)
        self.ports.device_bus.subscribe(partial(self._post, self._device_frame))
        self._outbox.extend(in_runs(self.holon.start(self._now_us())))
        self.ports.watchdog.ready()
        self._carry_out()

    async def stop(self) -> None:
        """Leave both buses; pending journal writes are finished first."""
        if self._timer is not None:
            self._timer.cancel()
        self._keep_quiet()
        # A write that ends may begin the next one.
        while self._writing is not None:
            await asyncio.wait([self._writing])
        await self.ports.fleet_bus.close()
        if self.ports.device_bus is not self.ports.fleet_bus:
            await self.ports.device_bus.close()
        await self.ports.journal.close()

    def power_off(self) -> None:
        """A write under way is lost with everything else, as when the board loses its power."""
        self._keep_quiet()
        if self._writing is not None:
            self._writing.cancel()

    @property
    def is_idle(self) -> bool:
        """Whether no journal write is under way, so that a frame is taken up at once."""
        return self._writing is None and not self._inbox

    def look_at_clock(self) -> None:
        """The holon's clock was set from outside: its next wish may come sooner than it was."""
        if self._writing is None:
            self._set_timer()

    def wire_drops(self) -> Counter[Reason]:
        """Frames of both buses that came to nothing below the holon, by reason."""
        return sum(self.holon.wire_drops, Counter())

    def note(self, reason: Reason) -> None:
        """Count what befell this controller outside its decisions; it is told with the drops."""
        self._queue_drops[reason] += 1

    def all_drops(self) -> Counter[Reason]:
        """All input that this machine dropped, by reason."""
        return self.wire_drops() + self.holon.drops

    def _now_us(self) -> int:
        return round(self._loop.time() * 1_000_000)

    # --- events in ---------------------------------------------------------------------------------------------

    def _post(self, handle: Callable[[Frame, int], list[Effect]], frame: Frame, time_us: int) -> None:
        if self._writing is None and not self._inbox:
            try:
                effects = handle(frame, time_us)
                if effects:
                    self._outbox.extend(in_runs(effects))
            except Exception as error:  # noqa: BLE001  # as in ``_guarded``, without its call: this is for every frame
                self._give_up(error)
            # Where nothing is to be said and nothing can have fallen due, all is as it was when this was done last.
            if self._outbox or not self.holon.schedule.is_asked:
                self._carry_out()
        elif len(self._inbox) < INBOX_LIMIT:
            self._inbox.append((handle, frame, time_us))
        else:
            self._queue_drops[Reason.QUEUE_FULL] += 1

    def _on_fleet_frame(self, frame: Frame, time_us: int) -> None:
        """The same as ``_post`` for the fleet bus, without its calls: this is for every frame."""
        if self._writing is not None or self._inbox:
            self._post(self._fleet_frame, frame, time_us)
            return
        try:
            message = self._feed(frame, time_us)
            if message is not None and (effects := self.holon.receive(message, time_us)):
                self._outbox.extend(in_runs(effects))
        except Exception as error:  # noqa: BLE001  # as in ``_guarded``
            self._give_up(error)
        if self._outbox or not self.holon.schedule.is_asked:
            self._carry_out()

    def _fleet_frame(self, frame: Frame, time_us: int) -> list[Effect]:
        message = self._decoders[0].feed(frame, time_us)
        return self.holon.receive(message, time_us) if message is not None else []

    def _device_frame(self, frame: Frame, time_us: int) -> list[Effect]:
        message = self._decoders[1].feed(frame, time_us)
        if message is None or message.sender != self.holon.node_id:
            return []
        return self.holon.sense(message, time_us)

    def _on_timer(self) -> None:
        self._timer = None
        self._timer_us = None
        if self._writing is not None:
            return
        self.holon.is_acknowledged = self._is_acknowledged()
        now_us = self._now_us()
        self.rest.woke(now_us)
        self._guarded(self.holon.wake, now_us)
        if not self.rest.is_in_doubt:
            self.ports.watchdog.alive()
        self._carry_out()

    def _is_acknowledged(self) -> bool:
        """Whether the bus has taken a frame of mine within the last two heartbeat periods."""
        if not self.holon.holding.is_apart:
            return True
        sent, now_us = self.ports.fleet_bus.health().sent, self._now_us()
        if sent != self._taken[0]:
            self._taken = sent, now_us
        return now_us - self._taken[1] <= 2 * self.holon.site.timing.heartbeat_us

    # --- effects out -------------------------------------------------------------------------------------------

    def _guarded(self, decide: Callable[_Given, Sequence[Effect]], *given: _Given.args, **named: _Given.kwargs) -> None:
        """A decision waits to be carried out; one that raises broke an invariant: the machine stops and says why."""
        try:
            self._outbox.extend(in_runs(decide(*given, **named)))
        except Exception as error:  # noqa: BLE001  # whatever it is, going on with a broken belief would be worse
            self._give_up(error)

    def _give_up(self, error: Exception) -> None:
        self._outbox.clear()
        self._halt(f"{type(error).__name__}: {error}", Reason.INVARIANT_BROKEN)

    def _carry_out(self) -> None:
        """Carry out effects and waiting events in order, as far as no journal write stands in between."""
        if self._outbox or self._inbox or self.taken_us is not None:
            self._guarded(self._work_off)
        if self._writing is None and self._unsent:
            self._writing = self._loop.create_task(self._wait_for_room())
        if self._writing is None and self._may_compact():
            self._writing = self._loop.create_task(self._compact())
        if self._writing is None:
            self._set_timer()

    def _may_compact(self) -> bool:
        """Nothing waits and nothing moves: whoever needs this machine's word meanwhile waits so long."""
        if self._fewer is None or not self.ports.journal.has_grown:
            return False
        return self.holon.halted is None and self.holon.behaviour.state is MachineState.IDLE

    def _work_off(self) -> tuple[()]:
        """Until a journal write begins or nothing is left; whatever is decided on the way is carried out as well."""
        while self._writing is None:
            if self.taken_us is not None and (taken_us := self.taken_us()):
                self._writing = self._loop.create_task(self._think(taken_us))
            elif self._outbox:
                self._perform(self._outbox.popleft())
            elif self._inbox:
                handle, frame, time_us = self._inbox.popleft()
                self._outbox.extend(in_runs(handle(frame, time_us)))
            else:
                break
        return ()

    def _perform(self, effect: Effect) -> None:
        match effect:
            case Send(message):
                self.outgoing.say(message, self._now_us())
                if self.outgoing.next_us is not None:
                    self._set_saying(self.outgoing.next_us)
            case Actuate(message) | Tell(message):
                for frame in self._codecs[1].encode(message):
                    self.ports.device_bus.send(frame)
            case Record():
                self._writing = self._loop.create_task(self._write(self.ports.journal.append(effect.entry)))
            case Renew():
                self._writing = self._loop.create_task(self._write(self.ports.journal.renew(effect.entries)))
            case Report(text):
                self.ports.telemetry.event(self._now_us(), self.holon.machine.name, text)
            case Halt(why, reason):
                self._halt(why, reason)

    def _put_on_bus(self, frame: Frame) -> None:
        bus = self.ports.fleet_bus
        if not self._unsent and (bus.send(frame) or bus.health().state is ErrorState.BUS_OFF):
            return
        self._unsent.append(frame)
        if self._writing is None:
            self._writing = self._loop.create_task(self._wait_for_room())

    async def _wait_for_room(self) -> None:
        """Nothing more is done before what was said is with the interface: it goes out in the order of its saying."""
        bus, taken_us = self.ports.fleet_bus, self._now_us()
        while self._unsent and self._now_us() < taken_us + NO_ROOM_US:
            if bus.send(self._unsent[0]):
                self._unsent.popleft()
                taken_us = self._now_us()
            else:
                await asyncio.sleep(ROOM_US / 1_000_000)
        self._unsent.clear()
        self._writing = None
        self._carry_out()

    def _say_more(self) -> None:
        """What waited for its budget goes out, and what is left has its next time."""
        self._saying = None
        self.outgoing.release(self._now_us())
        if self.outgoing.next_us is not None:
            self._set_saying(self.outgoing.next_us)

    def _set_saying(self, when_us: int) -> None:
        """An earlier timer stays: it finds nothing to say and sets the next one."""
        if self._saying is not None and self._saying.when() <= when_us / 1_000_000:
            return
        if self._saying is not None:
            self._saying.cancel()
        self._saying = self._loop.call_at(when_us / 1_000_000, self._say_more)

    def _keep_quiet(self) -> None:
        """What waits is never said."""
        self.outgoing.clear()
        self._unsent.clear()
        if self._saying is not None:
            self._saying.cancel()
            self._saying = None

    async def _write(self, writing: Awaitable[None]) -> None:
        try:
            await writing
        except OSError as error:
            # What cannot be made durable must not be said: the machine stops where its authority still holds.
            self._outbox.clear()
            self._halt(f"the journal cannot be written: {error}", None)
        self._writing = None
        self._carry_out()

    async def _think(self, taken_us: int) -> None:
        """What was decided is carried out once it is thought out; whatever happens meanwhile waits."""
        await asyncio.sleep(taken_us / 1_000_000)
        self._writing = None
        self._carry_out()

    async def _compact(self) -> None:
        assert self._fewer is not None
        try:
            await self.ports.journal.compact(self._fewer)
        except OSError as error:
            # The old records stand, so nothing is lost; it is tried again in this machine's next life.
            self._fewer = None
            self.ports.telemetry.event(self._now_us(), self.holon.machine.name, f"journal not shortened: {error}")
        self._writing = None
        self._carry_out()

    def _halt(self, why: str, reason: Reason | None) -> None:
        """Say why, and fall silent: the drives brake by themselves, and the tokens stay where they are."""
        if self.stopped is not None and not self.stopped.done():
            self.halted_for = reason
        self.holon.halted = self.holon.halted or why
        self._inbox.clear()
        self._keep_quiet()
        word = self.holon.last_word(reason or Reason.JOURNAL_LOST, needs_person=self.needs_person(reason))
        for frame in self._codecs[0].encode(word):
            self.ports.fleet_bus.send(frame)
        self.ports.telemetry.event(self._now_us(), self.holon.machine.name, f"halted: {why}")
        self.ports.watchdog.status(f"halted: {why}")
        if self.stopped is not None and not self.stopped.done():
            self.stopped.set_result(why)

    def _set_timer(self) -> None:
        """One timer for the holon's next wish; a later wish leaves an earlier timer in place."""
        due_us = self.holon.next_wake()
        if due_us is None or (self._timer_us is not None and self._timer_us <= due_us):
            return
        self.rest.due(due_us)
        if self.rest.is_broken:
            self._halt(self.rest.why, Reason.RUNAWAY)
            return
        if self._timer is not None:
            self._timer.cancel()
        self._timer_us = max(due_us, self._now_us())
        self._timer = self._loop.call_at(self._timer_us / 1_000_000, self._on_timer)
