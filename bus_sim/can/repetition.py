"""One node alone on a bus, which repeats a frame that nobody acknowledges: told in one step, however often it was.

Such a node is error-passive after sixteen attempts and counts nothing more (ISO 11898-1, 12.1.4.2, rule c), so every
attempt is as the one before, and what the bus did until somebody looks at it is a matter of division.
"""

from typing import NamedTuple

from bus_sim.can.bitstream import SUSPEND_BITS, frame_length_bits
from bus_sim.can.failures import acknowledgement_missing
from bus_sim.can.recovery import TICKS_PER_BIT
from bus_sim.can.statistics import LoadMeter
from onboard.core.frame import Frame


class Repetition(NamedTuple):
    """Attempts of one error-passive node, in ticks of the bus (1 / bit rate us) and bit times.

    ``start_ticks``: start of frame of the first; the sender notices after ``detected_bits`` that nobody acknowledged,
    and intermission is over after ``length_bits``.
    """

    start_ticks: int
    detected_bits: int
    length_bits: int

    @classmethod
    def of(cls, frame: Frame, start_ticks: int) -> "Repetition":
        """Of a frame that is on its way from now on."""
        failure = acknowledgement_missing(frame_length_bits(frame))
        return cls(start_ticks, failure.detected_bits, failure.length_bits)

    @property
    def period_ticks(self) -> int:
        """From one start of frame to the next: a suspended transmitter waits eight bits longer than others."""
        return (self.length_bits + SUSPEND_BITS) * TICKS_PER_BIT

    def failed_before(self, now_us: int, bit_rate: int) -> int:
        """Attempts that were given up before ``now_us``; of what happens at one time the bus comes last."""
        first_ticks = self.start_ticks + self.detected_bits * TICKS_PER_BIT
        return max(0, ((now_us - 1) * bit_rate - first_ticks) // self.period_ticks + 1)

    def book(self, meter: LoadMeter, attempts: int) -> None:
        """Count what so many attempts put on the bus."""
        meter.error_frames += attempts
        first_ticks = self.start_ticks + self.length_bits * TICKS_PER_BIT
        meter.occupy_again(first_ticks, self.period_ticks, self.length_bits, attempts)
