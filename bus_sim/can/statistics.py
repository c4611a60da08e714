"""What a bus carried: frames, errors and how full it was."""

from dataclasses import dataclass
from typing import Final

_SECOND_US: Final = 1_000_000


@dataclass(frozen=True, slots=True)
class BusStatistics:
    """Counts since the bus began. Loads are fractions, 0 to 1, of the bit rate; error frames count as load."""

    frames: int
    error_frames: int
    busy_bits: int
    mean_load: float
    worst_second_load: float


class LoadMeter:
    """Adds up bit times, in all and for each second of bus time.

    ``bit_rate`` in bit/s. What is put on the bus must be told in order of time and must not overlap.
    """

    def __init__(self, bit_rate: int, start_us: int) -> None:
        self.frames = 0
        self.error_frames = 0
        self.busy_bits = 0
        self._bit_rate = bit_rate
        self._start_us = start_us
        self._second_ends_us = (start_us // _SECOND_US + 1) * _SECOND_US
        # Ticks of 1 / (bit rate) us, as a frame over a second's end leaves parts of a bit on either side.
        self._ticks_this_second = 0
        self._worst_ticks = 0

    def occupy(self, end_us: int, bits: int) -> None:
        """The bus was taken for ``bits`` bit times up to ``end_us``."""
        self.busy_bits += bits
        if end_us >= self._second_ends_us:
            self._next_second(end_us, bits * _SECOND_US)
        else:
            self._ticks_this_second += bits * _SECOND_US

    def occupy_again(self, first_ticks: int, every_ticks: int, bits: int, times: int) -> None:
        """The bus was taken for ``bits`` bit times so often, the first up to ``first_ticks`` (us * bit rate)."""
        told = 0
        while told < times:
            self.occupy(-(-(first_ticks + told * every_ticks) // self._bit_rate), bits)
            last_ticks = (self._second_ends_us - 1) * self._bit_rate
            of_this_second = min(times, max(told, (last_ticks - first_ticks) // every_ticks) + 1)
            more = of_this_second - told - 1
            self.busy_bits += more * bits
            self._ticks_this_second += more * bits * _SECOND_US
            told = of_this_second

    def _next_second(self, end_us: int, ticks: int) -> None:
        second_begins_us = end_us // _SECOND_US * _SECOND_US
        after = min(ticks, (end_us - second_begins_us) * self._bit_rate)
        if second_begins_us == self._second_ends_us:
            self._ticks_this_second += ticks - after
        self._worst_ticks = max(self._worst_ticks, self._ticks_this_second)
        self._ticks_this_second = after
        self._second_ends_us = second_begins_us + _SECOND_US

    def snapshot(self, now_us: int) -> BusStatistics:
        """The figures up to now; a second that is not over counts as it stands."""
        passed_us = max(now_us - self._start_us, 1)
        worst = max(self._worst_ticks, self._ticks_this_second)
        return BusStatistics(
            frames=self.frames,
            error_frames=self.error_frames,
            busy_bits=self.busy_bits,
            mean_load=min(1.0, self.busy_bits * _SECOND_US / (passed_us * self._bit_rate)),
            worst_second_load=min(1.0, worst / (self._bit_rate * _SECOND_US)),
        )
