"""How busy the buses of a log were, and how long frames can have waited, beside the computed worst case.

A log says when a frame was over, not when it was queued. But a frame that waits keeps the bus from falling idle: it
cannot have been queued before the busy stretch in which it was sent began. So the time from the beginning of that
stretch to the frame's end is the most that its response can have been.
"""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.core.site import Site
from onboard.systems.registry import part
from onboard.trace.frame_bits import frame_bits
from onboard.trace.raw import RawFrame
from onboard.trace.response import Bound, fifo_bounds, priority_bounds
from onboard.wire.codec import Codecs

_SECOND_US = 1_000_000
#: Between frames of one busy stretch at most this many bit times seem idle: the rounding of time stamps.
_GAP_BITS = 4


@dataclass
class ChannelLoad:
    """One bus of a log. ``longest_us``: the most that a response can have been, by message."""

    name: str
    bit_rate: int
    frames: int = 0
    bits: int = 0
    flexible: int = 0
    first_us: int | None = None
    last_us: int = 0
    counts: Counter[str] = field(default_factory=Counter)
    longest_us: dict[str, int] = field(default_factory=dict)
    worst_second: float = 0.0
    worst_second_us: int = 0
    _second: int = -1
    _second_bits: int = 0
    _busy_from_us: float = 0.0

    @property
    def mean(self) -> float:
        """Share of the time from the first to the last frame in which the bus was busy."""
        span_us = self.last_us - (self.first_us or 0)
        return self.bits * 1e6 / (self.bit_rate * span_us) if span_us else 0.0

    def feed(self, frame: RawFrame, name: str) -> None:
        """Take up one frame; ``name`` is its message's."""
        classic = frame.classic()
        if classic is None:
            self.flexible += 1
            return
        bits = frame_bits(classic)
        self._count(frame.time_us, bits)
        self.counts[name] += 1
        began_us = frame.time_us - bits * 1e6 / self.bit_rate
        if self.first_us is None or began_us - self.last_us > _GAP_BITS * 1e6 / self.bit_rate:
            self._busy_from_us = began_us
        if self.first_us is None:
            self.first_us = frame.time_us
        self.last_us = max(self.last_us, frame.time_us)
        response_us = round(frame.time_us - self._busy_from_us)
        self.longest_us[name] = max(self.longest_us.get(name, 0), response_us)

    def finish(self) -> None:
        """The log has ended: count its last second too."""
        self._end_second()

    def _count(self, time_us: int, bits: int) -> None:
        self.frames += 1
        self.bits += bits
        second = time_us // _SECOND_US
        if second != self._second:
            self._end_second()
            self._second, self._second_bits = second, 0
        self._second_bits += bits

    def _end_second(self) -> None:
        share = self._second_bits / self.bit_rate
        if share > self.worst_second:
            self.worst_second, self.worst_second_us = share, self._second * _SECOND_US


def loads(frames: Iterable[RawFrame], codecs: Codecs, bit_rate: int) -> dict[str, ChannelLoad]:
    """The load of every bus in a log, in the order in which they are first heard."""
    found: dict[str, ChannelLoad] = {}
    for frame in frames:
        load = found.setdefault(frame.channel, ChannelLoad(frame.channel, bit_rate))
        load.feed(frame, _name(frame, codecs))
    for load in found.values():
        load.finish()
    return found


def _name(frame: RawFrame, codecs: Codecs) -> str:
    if frame.is_error:
        return "error frame"
    classic = frame.classic()
    if classic is None:
        return "CAN FD frame"
    return codecs.fleet.name_of(classic) or codecs.device.name_of(classic) or "other"


def bounds_of(site: Site) -> dict[str, tuple[int | None, int | None]]:
    """Worst cases by message, us: of nodes with one queue in order, as ours are, and of nodes that send by priority.

    None where a system's folder does not say (``traffic.py``) what its machines may send at most.
    """
    traffic = part(site.system, "traffic")
    if traffic is None:
        return {}
    streams = traffic.operation(site)
    in_order, by_priority = fifo_bounds(streams, site.bitrate), priority_bounds(streams, site.bitrate)
    names = dict.fromkeys(stream.name for stream in streams)
    return {name: (_greatest(in_order, name), _greatest(by_priority, name)) for name in names}


def _greatest(bounds: Iterable[Bound], name: str) -> int | None:
    times = [bound.response_us for bound in bounds if bound.stream.name == name]
    return None if None in times else max(time_us for time_us in times if time_us is not None)


def load_lines(
    found: Iterable[ChannelLoad], bounds: dict[str, tuple[int | None, int | None]], start_us: int
) -> list[str]:
    """Tables for people: the buses, then the messages of the bus that has bounds."""
    lines = [f"{'bus':<10} {'frames':>9} {'mean load':>10} {'worst second':>13}"]
    for load in found:
        at = f"at {max(0, load.worst_second_us - start_us) / 1e6:.0f} s"
        lines.append(f"{load.name:<10} {load.frames:>9} {load.mean:>10.2%} {load.worst_second:>13.2%} {at}")
        if load.flexible:
            lines.append(f"{'':<10} {load.flexible:>9} CAN FD frames, not counted")
    for load in found:
        lines += _messages(load, bounds)
    return lines


def _messages(load: ChannelLoad, bounds: dict[str, tuple[int | None, int | None]]) -> list[str]:
    known = [name for name in load.counts if name in bounds]
    lines = ["", f"{load.name}, ms from queueing to the frame's end{'' if known else ' (no bounds for this bus)'}"]
    lines.append(f"{'message':<22} {'frames':>9} {'at most':>9} {'bound':>9} {'by priority':>12}")
    for name, count in sorted(load.counts.items()):
        row = f"{name:<22} {count:>9} {load.longest_us[name] / 1000:>9.2f}"
        if name in bounds:
            fifo_us, priority_us = bounds[name]
            row += f" {_ms(fifo_us):>9} {_ms(priority_us):>12}"
            if fifo_us is not None and load.longest_us[name] > fifo_us:
                row += "  the bus was busy for longer than the bound"
        lines.append(row)
    return lines


def _ms(time_us: int | None) -> str:
    return "none" if time_us is None else f"{time_us / 1000:.2f}"
