"""Reading a driver: from the loop where there is a file descriptor to wait on, else from a thread.

python-can's ``Notifier`` is not used. Where it reads from the loop, an interface that goes down raises out of the
callback on every turn; where it reads from a thread, a listener that raises ends it in silence, and ``stop`` blocks.
"""

import asyncio
import threading
from collections import deque
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar

from onboard.io.transmit import call_in_loop

#: Frames that wait for the loop; at 500 kbit/s more than a second of a full bus.
QUEUE_LIMIT = 4096
#: How long a thread waits for a frame before it looks whether it should end, s; also the most a vanished server spins.
POLL_S = 0.1
#: Frames read in one turn of the loop, so that a full bus does not starve timers.
BATCH = 64

Item = TypeVar("Item")


class BusLostError(Exception):
    """The bus is gone for good; ``str`` says why."""


class Reader(Protocol):
    """Hands items of a driver to the loop until it is stopped; ``overflows`` counts those it had to drop."""

    overflows: int

    async def stop(self) -> None:
        """Stop; afterwards the driver may be shut down."""


class LoopReader(Generic[Item]):
    """Reads a driver that has a file descriptor. ``take(0)`` gives the next item, or None where none is there."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        descriptor: int,
        take: Callable[[float], Item | None],
        on_item: Callable[[Item], None],
        on_lost: Callable[[str], None],
    ) -> None:
        self.overflows = 0
        self._loop = loop
        self._descriptor = descriptor
        self._take = take
        self._on_item = on_item
        self._on_lost = on_lost
        self._stopped = False
        loop.add_reader(descriptor, self._readable)

    async def stop(self) -> None:
        """Take the descriptor off the loop; items that the driver still holds are not read."""
        self._remove()

    def _remove(self) -> None:
        if not self._stopped:
            self._stopped = True
            self._loop.remove_reader(self._descriptor)

    def _readable(self) -> None:
        try:
            for _ in range(BATCH):
                item = None if self._stopped else self._take(0)
                if item is None:
                    return
                self._on_item(item)
        except BusLostError as error:
            self._remove()
            self._on_lost(str(error))
            return
        # A driver that buffers in Python (slcan) may hold more than its descriptor shows.
        self._loop.call_soon(self._readable)


class ThreadReader(Generic[Item]):
    """Reads a driver from a thread. ``take(timeout)`` blocks for at most that many seconds.

    Items wait in a bounded queue for the loop; what comes while it is full is counted in ``overflows`` and lost, as
    in a CAN controller's receive queue.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        take: Callable[[float], Item | None],
        on_item: Callable[[Item], None],
        on_lost: Callable[[str], None],
        name: str,
    ) -> None:
        self.overflows = 0
        self._loop = loop
        self._take = take
        self._on_item = on_item
        self._on_lost = on_lost
        self._items: deque[Item] = deque()
        self._lock = threading.Lock()
        self._woken = False
        self._stopped = False
        self._thread = threading.Thread(target=self._run, name=f"receive {name}", daemon=True)
        self._thread.start()

    async def stop(self) -> None:
        """Stop, waiting for the thread as long as one poll may take."""
        self._stopped = True
        await self._loop.run_in_executor(None, self._thread.join, 5 * POLL_S)

    def _run(self) -> None:
        try:
            while not self._stopped:
                item = self._take(POLL_S)
                if item is not None and not self._put(item):
                    return
        except BusLostError as error:
            call_in_loop(self._loop, self._lost, str(error))

    def _put(self, item: Item) -> bool:
        with self._lock:
            if len(self._items) >= QUEUE_LIMIT:
                self.overflows += 1
                return True
            self._items.append(item)
            if self._woken:
                return True
            self._woken = True
        return call_in_loop(self._loop, self._drain)

    def _drain(self) -> None:
        for _ in range(BATCH):
            with self._lock:
                if not self._items or self._stopped:
                    self._woken = False
                    return
                item = self._items.popleft()
            self._on_item(item)
        self._loop.call_soon(self._drain)

    def _lost(self, why: str) -> None:
        if not self._stopped:
            self._on_lost(why)
