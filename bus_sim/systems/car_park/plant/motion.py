"""Motion along one axis in closed form: a list of phases of constant acceleration.

Own code on purpose: what judges a run shares nothing with the planner's kinematics. Positions in mm, speeds in mm/s
(signed, positive towards growing positions), times in microseconds.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

#: Differences of position below this, mm, are rounding.
EPSILON_MM = 1e-6


class MotionPhase(NamedTuple):
    """Constant acceleration ``a`` (mm/s^2) for ``duration`` seconds from position ``x`` (mm) and speed ``v`` (mm/s).

    ``begin`` is in seconds after the motion's start.
    """

    begin: float
    duration: float
    x: float
    v: float
    a: float

    @property
    def end(self) -> float:
        """Seconds after the motion's start."""
        return self.begin + self.duration

    def position(self, t: float) -> float:
        """Position ``t`` seconds after the motion's start."""
        s = t - self.begin
        return self.x + self.v * s + self.a * s * s / 2

    def speed(self, t: float) -> float:
        """Speed ``t`` seconds after the motion's start."""
        return self.v + self.a * (t - self.begin)


def stop_distance_mm(speed_mm_s: float, braking_mm_s2: float) -> float:
    """Way to a stand at full braking, signed like the speed: v |v| / 2a."""
    return speed_mm_s * abs(speed_mm_s) / (2 * braking_mm_s2)


@dataclass(frozen=True, slots=True)
class Motion:
    """What an axis does from ``start_us`` on unless it is ordered otherwise; it ends standing at ``final_mm``."""

    start_us: int
    phases: tuple[MotionPhase, ...]
    final_mm: float

    @property
    def end_us(self) -> int:
        """First whole microsecond at which the axis stands for good."""
        return self.start_us + (math.ceil(self.phases[-1].end * 1e6 - 1e-6) if self.phases else 0)

    def at(self, now_us: int) -> tuple[float, float]:
        """Position and speed at a time not before the start."""
        if now_us >= self.end_us:
            return self.final_mm, 0.0
        t = (now_us - self.start_us) / 1e6
        for phase in self.phases:
            if t <= phase.end:
                return phase.position(t), phase.speed(t)
        return self.final_mm, 0.0

    def next_reach_us(self, position_mm: float, after_us: int) -> int | None:
        """First whole microsecond after ``after_us`` at which a position has been reached or passed, None if never."""
        # Half a microsecond later, lest rounding finds the passage that was just told once more.
        after = (after_us - self.start_us + 0.5) / 1e6
        for phase in self.phases:
            for s in _roots(phase.a / 2, phase.v, phase.x - position_mm):
                if 0 <= s <= phase.duration and phase.begin + s > after:
                    return max(after_us + 1, self.start_us + math.ceil((phase.begin + s) * 1e6 - 1e-6))
        return None

    def extremes_mm(self, from_us: int, to_us: int) -> tuple[float, float]:
        """Lowest and highest position within a closed span of time."""
        lo, hi = (from_us - self.start_us) / 1e6, (to_us - self.start_us) / 1e6
        times = [lo, hi, *(t for t in self.turning_points() if lo < t < hi)]
        positions = [self._position(t) for t in times]
        return min(positions), max(positions)

    def turning_points(self) -> Iterator[float]:
        """Times, in seconds after the start, at which a phase begins, ends or reverses its direction."""
        for phase in self.phases:
            yield phase.begin
            if phase.a and 0 < -phase.v / phase.a < phase.duration:
                yield phase.begin - phase.v / phase.a
        if self.phases:
            yield self.phases[-1].end

    def state(self, t: float) -> tuple[float, float, float]:
        """Position, speed and acceleration just after ``t`` seconds from the start."""
        for phase in self.phases:
            if t < phase.end:
                return phase.position(t), phase.speed(t), phase.a
        return self.final_mm, 0.0, 0.0

    def shifted(self, by_mm: float) -> "Motion":
        """The same motion on an axis whose zero lies ``by_mm`` lower."""
        phases = tuple(phase._replace(x=phase.x + by_mm) for phase in self.phases)
        return Motion(self.start_us, phases, self.final_mm + by_mm) if by_mm else self

    def _position(self, t: float) -> float:
        return self.state(t)[0]


def standing(position_mm: float, now_us: int) -> Motion:
    """The motion of an axis that stands at ``position_mm`` from ``now_us`` on."""
    return Motion(now_us, (), position_mm)


def braking(position_mm: float, speed_mm_s: float, braking_mm_s2: float, now_us: int) -> Motion:
    """Full braking to a stand from any state."""
    if speed_mm_s == 0:
        return standing(position_mm, now_us)
    path = _Path(position_mm, speed_mm_s)
    path.to_speed(0.0, braking_mm_s2)
    return Motion(now_us, tuple(path.phases), path.x)


def driving(
    position_mm: float, speed_mm_s: float, target_mm: float, limit_mm_s: float, rate_mm_s2: float, now_us: int
) -> Motion:
    """The fastest motion from any state to rest at ``target_mm``: trapezoid or triangle, after a reversal if needed.

    ``limit_mm_s`` above 0 bounds the speed, ``rate_mm_s2`` above 0 acceleration and braking; an axis that is faster
    than its limit brakes down to it, one that cannot stop in time overshoots and comes back.
    """
    path = _Path(position_mm, speed_mm_s)
    if _must_turn(position_mm, speed_mm_s, target_mm, rate_mm_s2):
        path.to_speed(0.0, rate_mm_s2)
    way = target_mm - path.x
    if abs(way) > EPSILON_MM:
        sign = math.copysign(1.0, way)
        # Mirrored so that the way is positive: up to the peak, along at it, down to rest.
        peak = min(math.sqrt(rate_mm_s2 * abs(way) + path.v * path.v / 2), max(limit_mm_s, 0.0))
        path.to_speed(sign * peak, rate_mm_s2)
        rest = abs(target_mm - path.x) - peak * peak / (2 * rate_mm_s2)
        path.cruise(max(0.0, rest) / peak)
        path.to_speed(0.0, rate_mm_s2)
    elif path.v:
        path.to_speed(0.0, rate_mm_s2)
    return Motion(now_us, tuple(path.phases), target_mm)


def _must_turn(position_mm: float, speed_mm_s: float, target_mm: float, rate_mm_s2: float) -> bool:
    """Whether the axis moves away from its target or is too near to stop in time."""
    if speed_mm_s == 0:
        return False
    way = (target_mm - position_mm) * math.copysign(1.0, speed_mm_s)
    return way < abs(stop_distance_mm(speed_mm_s, rate_mm_s2)) - EPSILON_MM


class _Path:
    """Phases appended one after the other."""

    def __init__(self, x: float, v: float) -> None:
        self.x, self.v, self.t = x, v, 0.0
        self.phases: list[MotionPhase] = []

    def to_speed(self, v: float, rate: float) -> None:
        self._append(abs(v - self.v) / rate, math.copysign(rate, v - self.v))
        self.v = v

    def cruise(self, duration: float) -> None:
        self._append(duration, 0.0)

    def _append(self, duration: float, a: float) -> None:
        if duration <= 0:
            return
        phase = MotionPhase(self.t, duration, self.x, self.v, a)
        self.phases.append(phase)
        self.t = phase.end
        self.x = phase.position(phase.end)
        self.v = phase.speed(phase.end)


def _roots(a: float, b: float, c: float) -> list[float]:
    """Real roots of a s^2 + b s + c in growing order."""
    if a == 0:
        return [-c / b] if b else []
    # A root at which the axis just touches the position may come out slightly complex.
    square = b * b - 4 * a * c
    if square < -1e-6 * max(1.0, b * b):
        return []
    root = math.sqrt(max(0.0, square))
    q = -(b + math.copysign(root, b)) / 2
    found = [q / a, c / q] if q else [0.0]
    return sorted(found)
