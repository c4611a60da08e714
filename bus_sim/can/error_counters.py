"""Fault confinement of one CAN controller: the two error counters and the states they make (ISO 11898-1, 12.1.4)."""

from dataclasses import dataclass
from typing import Final

from onboard.ports.bus import ErrorState

#: Above this, either counter makes a node error-passive.
PASSIVE_ABOVE: Final = 127
#: Above this, the transmit error counter switches a node off the bus.
BUS_OFF_ABOVE: Final = 255
#: A node that was switched off may come back after this many sequences ...
RECOVERY_SEQUENCES: Final = 128
#: ... of this many recessive bits in a row.
RECOVERY_BITS: Final = 11
#: What a successful reception makes of a REC above 127; the standard allows 119 to 127.
_REC_AFTER_PASSIVE: Final = 127


@dataclass(slots=True)
class ErrorCounters:
    """TEC and REC. Once off the bus a controller stays off until ``reset``."""

    tec: int = 0
    rec: int = 0

    @property
    def state(self) -> ErrorState:
        """The state that the counters stand for."""
        if self.tec > BUS_OFF_ABOVE:
            return ErrorState.BUS_OFF
        if self.tec > PASSIVE_ABOVE or self.rec > PASSIVE_ABOVE:
            return ErrorState.ERROR_PASSIVE
        return ErrorState.ERROR_ACTIVE

    def transmission_failed(self) -> None:
        """A transmitter sent an error flag: TEC + 8 (rule c)."""
        self.tec += 8

    def acknowledgement_missing(self) -> None:
        """Nobody acknowledged: as any failure, except that an error-passive transmitter counts nothing (rule c, 1).

        So a node that is alone on the bus ends at 128 and never goes bus-off.
        """
        if self.state is not ErrorState.ERROR_PASSIVE:
            self.tec += 8

    def reception_failed(self, *, detected_first: bool) -> None:
        """A receiver saw an error: REC + 1 (rule a), and 8 more where the others followed its flag (rule b)."""
        self.rec += 9 if detected_first else 1

    def transmission_succeeded(self) -> None:
        """TEC - 1, not below 0 (rule g)."""
        if self.tec:
            self.tec -= 1

    def reception_succeeded(self) -> None:
        """REC - 1, not below 0; from above 127 straight to 127 (rule h)."""
        if self.rec > PASSIVE_ABOVE:
            self.rec = _REC_AFTER_PASSIVE
        elif self.rec:
            self.rec -= 1

    def reset(self) -> None:
        """After bus-off recovery both counters are 0 and the node is error-active."""
        self.tec = self.rec = 0
