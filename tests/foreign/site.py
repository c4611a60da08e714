"""What a builder takes from the file of a site with one alley (docs/site-file.md): numbers, and the times of ways."""

from dataclasses import dataclass
from math import ceil, sqrt


@dataclass(frozen=True)
class Alley:
    """One alley, one compartment. Lengths in mm, times in us."""

    node: int
    nodes: tuple[int, ...]
    digest: int
    bitrate: int
    steward: int
    length: int
    home: int
    bay: int
    places: tuple[int, ...]
    track: int = 1
    pitch_mm: int = 2_400
    body_mm: int = 2_300
    speed_mm_s: int = 1_500
    acceleration_mm_s2: int = 500
    reach_mm: int = 5_400
    shuttle_mm_s: int = 750
    call_us: int = 1_000_000
    bid_delay_us: int = 300_000
    bid_half_us: int = 10_000_000
    guard_us: int = 20_000
    beat_us: int = 2_000_000
    refresh_us: int = 200_000
    door_us: int = 3_000_000
    grip_us: int = 2_000_000

    def run_us(self, slots: int) -> int:
        """P4: a run over so many slots, in whole ms."""
        return _run_us(abs(slots) * self.pitch_mm, self.speed_mm_s, self.acceleration_mm_s2)

    def handling_us(self, station: int) -> int:
        """B3: reach, grip or release, retract; at the bay its door opens first."""
        stroke_us = _run_us(self.reach_mm, self.shuttle_mm_s, self.acceleration_mm_s2)
        return 2 * stroke_us + self.grip_us + 400_000 + (self.door_us if station == self.bay else 0)

    @property
    def soon(self) -> int:
        """K15: slots of the braking distance and of three seconds of way."""
        way_mm = self.speed_mm_s**2 // (2 * self.acceleration_mm_s2) + 3 * self.speed_mm_s
        return -(-way_mm // self.pitch_mm)

    def slot_us(self) -> tuple[int, int]:
        """B4: where my slot begins in a round, and how long the round is."""
        length_us = 480 * 1_000_000 // self.bitrate + 500
        return sorted(self.nodes).index(self.node) * length_us, len(self.nodes) * length_us

    def occupied(self, position_mm: int) -> list[int]:
        """Indices of the slots that a body is in."""
        low, high = position_mm - self.body_mm // 2, position_mm + self.body_mm // 2
        return list(range(self.index_at(low), self.index_at(high) + 1))

    def index_at(self, position_mm: int) -> int:
        """The slot of a position."""
        return min(self.length, max(1, (position_mm + self.pitch_mm // 2) // self.pitch_mm + 1))


def _run_us(way_mm: int, speed: int, acceleration: int) -> int:
    if way_mm * acceleration >= speed * speed:
        seconds = way_mm / speed + speed / acceleration
    else:
        seconds = 2 * sqrt(way_mm / acceleration)
    return ceil(round(seconds * 1e6) / 1000) * 1000


def index_of(station: int) -> int:
    """The index of the segment beside a station."""
    return station & 0x7F


def side_of(station: int) -> str:
    """On which side of it the station is."""
    return "FAR" if station >> 7 & 1 else "NEAR"


def delay_us(above_us: int, most_us: int, half_us: int) -> int:
    """B4: W x / (x + h)."""
    return most_us * above_us // (above_us + half_us) if above_us > 0 else 0
