"""An asyncio event loop whose clock is a number: virtual time in whole microseconds, as fast as possible or paced.

Nothing in here sleeps unless a pace is set or the outside world (a socket, a worker thread) is waited for. Timers fire
in the order of (time, sequence of setting); asyncio's own heap compares times only and so does not keep that order.
Each timer is followed by everything that it made ready before the next timer of the same time fires.
"""

import asyncio
import heapq
import itertools
import selectors
import time
from collections import deque
from collections.abc import Callable, Coroutine, Mapping
from concurrent.futures import Executor
from contextvars import Context
from typing import Any, Protocol, TypeVar, TypeVarTuple, Unpack

from onboard.io.collector import MANY, rare_looks

_T = TypeVar("_T")
_Ts = TypeVarTuple("_Ts")
_FileObject = int | Any

#: Timers fired in a row before sockets, the self-pipe and signals get a look.
_TIMERS_IN_A_ROW = 512
#: More than this at one moment of virtual time is a standstill. A large site takes 33 timers at power-up (measured).
_MOST_AT_ONCE = 20_000
#: A paced clock that is later than this, in wall seconds, gives up the debt instead of racing to pay it back.
_LARGEST_LAG_S = 1.0
#: Cancelled timers are swept from the heap when they are more than this and more than half of it.
_SWEEP_AT = 256


class StandstillError(RuntimeError):
    """So much happens at one moment that virtual time would never go on; says who does it."""


class EventLimitError(RuntimeError):
    """A run has taken more events than it was given: it is taken for one that hangs."""


class DeadlockError(RuntimeError):
    """Nothing is ready, no timer is set and nobody outside can wake the loop: virtual time would stand still."""


class Clock(Protocol):
    """A clock and calls at chosen times, in whole microseconds; calls of equal time are made in the order asked for."""

    def now_us(self) -> int:
        """The present in whole us, from an origin of the clock's own."""

    def at_us(self, when_us: int, callback: Callable[[int], None]) -> None:
        """Call ``callback(when_us)`` at ``when_us``, or as soon as possible where that is past. Cannot be cancelled."""


class VirtualTimer(asyncio.TimerHandle):
    """An asyncio timer that knows whether it is still in the loop's heap."""

    __slots__ = ("waiting",)

    def __init__(
        self,
        when: float,
        callback: Callable[..., object],
        args: tuple[Any, ...],
        loop: asyncio.AbstractEventLoop,
        context: Context | None,
    ) -> None:
        super().__init__(when, callback, args, loop, context)
        self.waiting = True


#: (time in microseconds, sequence, asyncio's timer or None, the plain callback where there is no timer)
_Entry = tuple[int, int, VirtualTimer | None, Callable[[int], None] | None]


class VirtualTimeLoop(asyncio.SelectorEventLoop):
    """A selector event loop in virtual time; implements ``Clock`` as well.

    Without ``pace`` the clock jumps to the next timer whenever nothing is ready. With ``pace`` it follows the wall
    clock, ``pace`` virtual seconds to a wall second (1.0 real time, 10.0 ten times as fast), and sockets are served
    while it waits. Either way a callback sees the exact microsecond that it was set for, and the clock stands still
    while callbacks run. While a job of ``run_in_executor`` is out, an unpaced clock waits for it: threads take no
    virtual time. An exception in a callback set by ``at_us`` ends the run; asyncio's own callbacks keep asyncio's rule.

    Raises ``ValueError`` where ``pace`` is not positive. ``run_until_complete`` raises ``DeadlockError``, and
    ``StandstillError`` and ``EventLimitError`` where virtual time does not go on, or not within ``event_limit`` timers.
    """

    def __init__(self, *, start_us: int = 0, pace: float | None = None) -> None:
        #: Wall seconds that a paced clock gave up because the machine was too slow for it.
        self.slipped_s = 0.0
        self.pace = pace
        self._now_us = start_us
        self._anchor = (time.monotonic(), start_us)
        self._timers: list[_Entry] = []
        self._sequence = itertools.count()
        self._cancelled_timers = 0
        self._jobs_outside = 0
        #: Timers fired so far, and how many may be; what a run takes is the same on every machine.
        self.events = 0
        self.event_limit: int | None = None
        self._at_once = 0
        self._stop_asked = False
        self._paused = False
        selector = _Selector()
        super().__init__(selector)
        # asyncio's own queue of ready handles: there is no public way to ask whether something is ready.
        self._ready_handles: deque[asyncio.Handle] = vars(self)["_ready"]
        selector.loop = self
        self._waits = selector
        if pace is not None and not pace > 0:
            # Only now: asyncio insists on closing a loop, and can close only what it has set up.
            self.close()
            raise ValueError(f"pace {pace}: must be a positive number of virtual seconds a second, or None")

    # --- the clock ---------------------------------------------------------------------------------------------

    def time(self) -> float:
        """Virtual seconds; ``round(loop.time() * 1e6)`` is the exact microsecond."""
        return self._now_us / 1e6

    def now_us(self) -> int:
        """Virtual time since the loop was made, in whole us."""
        return self._now_us

    def set_pace(self, pace: float | None) -> None:
        """Follow the wall clock from now on, ``pace`` virtual seconds to a wall second, or hurry where it is None.

        Raises ``ValueError`` where ``pace`` is not positive.
        """
        if pace is not None and not pace > 0:
            raise ValueError(f"pace {pace}: must be a positive number of virtual seconds a second, or None")
        self.pace = pace
        self._anchor = (time.monotonic(), self._now_us)
        # What is due is looked at again under the new pace.
        self._stop_asked = True

    def pause(self) -> None:
        """Stand still until ``resume``: no timer fires, sockets are served. The moment is that of the next turn."""
        self._paused = True
        self._stop_asked = True

    def resume(self) -> None:
        """Go on from where the clock stands, at the pace that was set."""
        self._paused = False
        self._anchor = (time.monotonic(), self._now_us)

    def at_us(self, when_us: int, callback: Callable[[int], None]) -> None:
        """Call ``callback(when_us)`` at a virtual time; about twice as fast as ``call_at``."""
        due_us = when_us if when_us > self._now_us else self._now_us
        heapq.heappush(self._timers, (due_us, next(self._sequence), None, callback))

    def call_at(
        self,
        when: float,
        callback: Callable[[Unpack[_Ts]], object],
        *args: *_Ts,
        context: Context | None = None,
    ) -> asyncio.TimerHandle:
        """As asyncio's, with ``when`` rounded to a whole microsecond and never before the present."""
        self._check_open()
        timer = VirtualTimer(when, callback, args, self, context)
        when_us = max(round(when * 1e6), self._now_us)
        heapq.heappush(self._timers, (when_us, next(self._sequence), timer, None))
        return timer

    def run_forever(self) -> None:
        """As asyncio's. Words and beliefs make no rings: to look for some as often as usual takes a tenth of it all."""
        with rare_looks(MANY):
            super().run_forever()

    def stop(self) -> None:
        """End ``run_forever`` after this turn, also from a wait for the wall clock."""
        self._stop_asked = True
        super().stop()

    def close(self) -> None:
        """As asyncio's; pending timers are dropped."""
        self._timers.clear()
        super().close()

    def go_on_in_copy(self) -> None:
        """To be called in a copy of the process (``os.fork``) that was made in a call of this loop.

        asyncio takes a loop for running only in the process that ran it, and a selector would be shared with that one.
        """
        asyncio._set_running_loop(self)  # noqa: SLF001  # as asyncio's own loops do; there is no other name for it
        self._waits.renew()

    # --- the world outside -------------------------------------------------------------------------------------

    def run_in_executor(
        self, executor: Executor | None, func: Callable[[Unpack[_Ts]], _T], *args: *_Ts
    ) -> asyncio.Future[_T]:
        """As asyncio's; virtual time waits for the job."""
        future = super().run_in_executor(executor, func, *args)
        self._jobs_outside += 1
        future.add_done_callback(self._job_came_back)
        return future

    async def shutdown_default_executor(
        self,
        timeout: float | None = None,  # noqa: ASYNC109  # the base class has it
    ) -> None:
        """As asyncio's; virtual time waits for the threads, so ``timeout`` is not needed and not used."""
        self._jobs_outside += 1
        try:
            await super().shutdown_default_executor()
        finally:
            self._jobs_outside -= 1

    def _job_came_back(self, _future: asyncio.Future[Any]) -> None:
        self._jobs_outside -= 1

    # --- one turn of the loop ----------------------------------------------------------------------------------

    def _check_open(self) -> None:
        if self.is_closed():
            raise RuntimeError("Event loop is closed")

    def _timer_handle_cancelled(self, handle: asyncio.TimerHandle) -> None:
        """Called by asyncio's timers when they are cancelled: long runs must not carry them along."""
        if not isinstance(handle, VirtualTimer) or not handle.waiting:
            return
        self._cancelled_timers += 1
        if self._cancelled_timers > _SWEEP_AT and 2 * self._cancelled_timers > len(self._timers):
            # In place and without the one being cancelled, which does not yet say so itself.
            self._timers[:] = [e for e in self._timers if e[2] is None or not (e[2] is handle or e[2].cancelled())]
            heapq.heapify(self._timers)
            self._cancelled_timers = 0

    def turn(self, selector: "_Selector") -> "list[_Event]":
        """Nothing is ready: look outside, else move the clock and fire timers until something is ready."""
        timers = self._timers
        while timers and (head := timers[0][2]) is not None and head.cancelled():
            heapq.heappop(timers)
            self._cancelled_timers -= 1
        if self._paused:
            return selector.poll(None)
        if self.pace is not None:
            return self._turn_paced(selector, self.pace)
        events = self._look_outside(selector)
        if not events:
            self._fire(None)
        return events

    def _look_outside(self, selector: "_Selector") -> "list[_Event]":
        if self._jobs_outside or (not self._timers and selector.has_guests()):
            return selector.poll(None)
        if not self._timers:
            raise DeadlockError(self._why_stuck())
        return selector.poll(0)

    def _turn_paced(self, selector: "_Selector", pace: float) -> "list[_Event]":
        """Wait for the next timer or for the world; what arrives meets a clock that followed the wall clock."""
        wait_s: float | None = None
        if self._timers:
            wall, virtual_us = self._anchor
            wait_s = wall + (self._timers[0][0] - virtual_us) / (1e6 * pace) - time.monotonic()
            if wait_s < -_LARGEST_LAG_S:
                self.slipped_s -= wait_s
                self._anchor = (wall - wait_s, virtual_us)
        events = selector.poll(None if wait_s is None else max(wait_s, 0.0))
        wall, virtual_us = self._anchor
        wall_us = virtual_us + int((time.monotonic() - wall) * 1e6 * pace)
        self._fire(wall_us)
        if events:
            limit_us = min(wall_us, self._timers[0][0]) if self._timers else wall_us
            self._now_us = max(self._now_us, limit_us)
        return events

    def _fire(self, limit_us: int | None) -> None:
        timers, ready = self._timers, self._ready_handles
        pop = heapq.heappop
        self._stop_asked = False
        for _ in range(_TIMERS_IN_A_ROW):
            if not timers or ready or self._stop_asked or (limit_us is not None and timers[0][0] > limit_us):
                return
            when_us, _sequence, timer, callback = pop(timers)
            if timer is not None and timer.cancelled():
                self._cancelled_timers -= 1
                continue
            self._count(when_us, timer, callback)
            if callback is not None:
                callback(when_us)
            elif timer is not None:
                timer.waiting = False
                timer._run()  # noqa: SLF001  # as asyncio does: context, and its rule for exceptions

    def _count(self, when_us: int, timer: VirtualTimer | None, callback: Callable[[int], None] | None) -> None:
        """One timer more, at ``when_us``: the clock goes there."""
        self._at_once = self._at_once + 1 if when_us == self._now_us else 0
        self._now_us = when_us
        self.events += 1
        if self.event_limit is not None and self.events > self.event_limit:
            raise EventLimitError(f"{self.event_limit} events are over at {when_us / 1e6:.6f} s of virtual time")
        if self._at_once > _MOST_AT_ONCE:
            who = _name_of(callback if timer is None else timer)
            raise StandstillError(
                f"virtual time stands still at {when_us / 1e6:.6f} s: {self._at_once} timers there, now one of {who}"
            )

    def note_turn(self) -> None:
        """Something is ready without a timer; for ever at one moment is a standstill as well."""
        if self.pace is not None or self._paused:
            return
        self._at_once += 1
        if self._at_once > _MOST_AT_ONCE:
            who = ", ".join(sorted({_name_of(one) for one in itertools.islice(self._ready_handles, 5)}))
            raise StandstillError(f"virtual time stands still at {self._now_us / 1e6:.6f} s: ready for ever is {who}")

    def _why_stuck(self) -> str:
        waiting = sorted(getattr(task.get_coro(), "__qualname__", "?") for task in asyncio.all_tasks(self))
        who = ", ".join(waiting[:5]) + (f" and {len(waiting) - 5} more" if len(waiting) > 5 else "")
        return (
            f"deadlock at {self._now_us / 1e6:.6f} s of virtual time: nothing is ready, no timer is set and nothing "
            f"outside is waited for; tasks that wait: {who or 'none'}"
        )


_Event = tuple[selectors.SelectorKey, int]


class _Selector(selectors.BaseSelector):
    """asyncio asks its selector to wait; this one asks the loop to move its clock instead."""

    def __init__(self) -> None:
        self._inner = selectors.DefaultSelector()
        self._looks_saved = 0
        self.loop: VirtualTimeLoop | None = None

    def register(self, fileobj: _FileObject, events: int, data: Any = None) -> selectors.SelectorKey:
        return self._inner.register(fileobj, events, data)

    def unregister(self, fileobj: _FileObject) -> selectors.SelectorKey:
        return self._inner.unregister(fileobj)

    def modify(self, fileobj: _FileObject, events: int, data: Any = None) -> selectors.SelectorKey:
        return self._inner.modify(fileobj, events, data)

    def get_map(self) -> Mapping[_FileObject, selectors.SelectorKey]:
        return self._inner.get_map()

    def close(self) -> None:
        self._inner.close()

    def renew(self) -> None:
        """Watch the same with a selector of the system's own."""
        watched, self._inner = list(self._inner.get_map().values()), selectors.DefaultSelector()
        for key in watched:
            self._inner.register(key.fileobj, key.events, key.data)

    def has_guests(self) -> bool:
        """Whether any file descriptor but the loop's own self-pipe is watched."""
        return len(self._inner.get_map()) > 1

    def poll(self, timeout: float | None) -> list[_Event]:
        """Really look at the file descriptors; an unpaced loop without guests saves most of the system calls."""
        if timeout == 0 and not self.has_guests():
            self._looks_saved += 1
            if self._looks_saved < 64:
                return []
        self._looks_saved = 0
        return self._inner.select(timeout)

    def select(self, timeout: float | None = None) -> list[_Event]:
        if self.loop is None:
            return self._inner.select(timeout)
        if timeout != 0:
            return self.loop.turn(self)
        if not self.has_guests():
            self.loop.note_turn()
        return self.poll(0)


def _name_of(what: object) -> str:
    """The machine whose controller something belongs to, else what it is called in the program."""
    callback = getattr(what, "_callback", what)
    owner = getattr(callback, "__self__", None)
    name = getattr(getattr(getattr(owner, "holon", None), "machine", None), "name", None)
    return name if isinstance(name, str) else getattr(callback, "__qualname__", repr(callback))


class LoopClock:
    """A ``Clock`` on any asyncio loop; where that is not a ``VirtualTimeLoop``, calls of equal time may swap."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._floor_us = 0

    def now_us(self) -> int:
        """Never before the time of the call being made, although a loop may wake early."""
        return max(self._floor_us, now_us(self._loop))

    def at_us(self, when_us: int, callback: Callable[[int], None]) -> None:
        """Call ``callback(when_us)`` at this time of the loop, which may wake some us early."""
        self._loop.call_at(when_us / 1e6, self._call, when_us, callback)

    def _call(self, when_us: int, callback: Callable[[int], None]) -> None:
        self._floor_us = max(self._floor_us, when_us)
        callback(when_us)


def now_us(loop: asyncio.AbstractEventLoop) -> int:
    """The time of any asyncio loop in microseconds; exact on a ``VirtualTimeLoop``."""
    return round(loop.time() * 1e6)


def run(main: Coroutine[Any, Any, _T], *, start_us: int = 0, pace: float | None = None) -> _T:
    """``asyncio.run`` on a ``VirtualTimeLoop``. Raises ``DeadlockError`` and whatever ``main`` raises."""
    with asyncio.Runner(loop_factory=lambda: VirtualTimeLoop(start_us=start_us, pace=pace)) as runner:
        return runner.run(main)


def run_on(loop: VirtualTimeLoop, main: Coroutine[Any, Any, _T]) -> _T:
    """The same on a loop that ``main`` knows already; in the end what still waits is cancelled and the loop closed."""
    with asyncio.Runner(loop_factory=lambda: loop) as runner:
        return runner.run(main)
