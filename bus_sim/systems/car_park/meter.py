"""How long frames take on a running fleet bus: from being said to their end, and how much of that the bus takes."""

from collections import deque
from dataclasses import dataclass, field
from functools import partial

from bus_sim.can.error_frames import ErrorsHeard
from bus_sim.can.medium import Medium
from onboard.contract.codes import TaskPhase
from onboard.contract.messages import TaskReport
from onboard.controller.outgoing import Outgoing
from onboard.core.frame import Frame
from onboard.wire.codec import fleet_codec

#: All machines have found each other by then, us; the first car comes later.
POWER_UP_US = 12_000_000


@dataclass
class Meter:
    """Queueing and response of every frame of a medium's nodes.

    A frame is said when its program says it, and queued when its budget lets it go to the bus.
    """

    #: Time queued (us), node-ID and message, in order of time.
    queued: list[tuple[int, int, str]] = field(default_factory=list)
    #: Worst response in us from being said, by message, of frames said while all start and afterwards.
    worst: dict[tuple[bool, str], int] = field(default_factory=dict)
    #: The same from being queued: the part of it that the bus takes.
    on_bus: dict[tuple[bool, str], int] = field(default_factory=dict)
    frames: int = 0
    #: Of these, heartbeats and bus time, which come whether anybody works or not.
    periodic: int = 0
    #: Frames that were never sent, as a later one said more.
    replaced: int = 0
    tasks: int = 0
    _said: dict[tuple[str, Frame], deque[int]] = field(default_factory=dict)
    _waiting: dict[str, deque[tuple[int, Frame]]] = field(default_factory=dict)

    def watch(self, fleet: Medium) -> None:
        """Watch a fleet bus that has not begun."""
        fleet.tap_queues(self._on_queued)
        fleet.tap(self._on_end, errors=ErrorsHeard.NONE)

    def listen(self, name: str, outgoing: Outgoing) -> None:
        """Take note of what one machine says; ``name`` is that of its node."""
        outgoing.on_said, outgoing.on_dropped = partial(self.on_said, name), partial(self._on_dropped, name)

    def on_said(self, name: str, frame: Frame, time_us: int) -> None:
        """A machine says a frame."""
        self._said.setdefault((name, frame), deque()).append(time_us)

    def _on_dropped(self, name: str, frame: Frame) -> None:
        self.replaced += 1
        self._said[name, frame].pop()

    def _on_queued(self, frame: Frame, time_us: int, node: str) -> None:
        name = fleet_codec().name_of(frame) or "?"
        self.queued.append((time_us, frame.arbitration_id & 0xFF, name))
        self._waiting.setdefault(node, deque()).append((time_us, frame))

    def _on_end(self, frame: Frame, time_us: int, node: str) -> None:
        queued_us, first = self._waiting[node].popleft()
        assert first == frame, "what is queued leaves in order"
        self.frames += 1
        self.periodic += fleet_codec().name_of(frame) in ("Heartbeat", "BusTime")
        name = fleet_codec().name_of(frame) or "?"
        _note(self.on_bus, (queued_us < POWER_UP_US, name), time_us - queued_us)
        said_us = self._said[node, frame].popleft()
        _note(self.worst, (said_us < POWER_UP_US, name), time_us - said_us)
        message = fleet_codec().decode_part(frame)
        if isinstance(message, TaskReport) and message.phase is TaskPhase.DONE:
            self.tasks += 1


def _note(worst: dict[tuple[bool, str], int], key: tuple[bool, str], us: int) -> None:
    worst[key] = max(worst.get(key, 0), us)
