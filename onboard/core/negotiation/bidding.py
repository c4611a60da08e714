"""When to speak, until when, and which bid is better: the rules that keep the bus quiet."""

from collections.abc import Callable
from typing import NamedTuple

from onboard.contract.codes import Criterion
from onboard.core.serial import ms_after
from onboard.core.site import Site, Timing

#: How long a bidder waits: from its cost, the call's floor, the criterion and the site's times, in us.
DelayRule = Callable[[int, int, Criterion, Timing], int]

#: Worst-case classic frame of 8 bytes with a 29-bit identifier, in bits (Davis, Burns, Bril, Lukkien 2007).
_FRAME_BITS = 160
#: A bid waits at most for a frame on the wire and one of higher priority, then is sent itself: three frames.
_FRAMES_TO_HEAR = 3
#: What a controller may take to read a bid, us: plausible for a small board, not measured on one.
_READING_US = 500

#: A finishing time may be this much before the floor, ms: floors are worked out when a call is heard.
FLOOR_SLACK_MS = 500


def cost_difference(cost: int, other: int, criterion: Criterion) -> int:
    """``cost - other`` in the criterion's unit; finishing times wrap (RFC 1982), money and length do not."""
    if criterion is Criterion.FINISH_TIME:
        return ms_after(cost, other)
    return cost - other


def beats(cost: int, node: int, other_cost: int, other_node: int, criterion: Criterion) -> bool:
    """Whether a bid is better than another: lower cost, then lower node-ID (decision on flag 10)."""
    difference = cost_difference(cost, other_cost, criterion)
    return difference < 0 or (difference == 0 and node < other_node)


def is_below(cost: int, floor: int, criterion: Criterion) -> bool:
    """Whether a bid is better than anybody could be; finishing times by more than what rounding and clocks make."""
    slack = FLOOR_SLACK_MS if criterion is Criterion.FINISH_TIME else 0
    return cost_difference(cost, floor, criterion) < -slack


def delay_us(cost: int, floor: int, criterion: Criterion, timing: Timing) -> int:
    """How long a bidder waits before it speaks: W x / (x + h), x its cost above the floor (design, section 4).

    Better bids speak sooner; W is ``bid_delay_us``, h ``bid_half_us``. x is in us for a finishing time, else in the
    criterion's unit times 1000, so that one site constant h serves a time of 10 s and a price of 100 alike.
    """
    above = max(0, cost_difference(cost, floor, criterion)) * 1000
    return timing.bid_delay_us * above // (above + timing.bid_half_us)


class SpeakingSlot(NamedTuple):
    """When in each round of ``slots`` times ``length_us`` a machine may begin to speak: in slot ``number``, from 0.

    A length of 0 means at any time.
    """

    number: int
    slots: int
    length_us: int


#: No slots: machines whose delays end within one bus latency then speak all at once.
ANY_TIME = SpeakingSlot(0, 1, 0)


def slot_of(site: Site, node_id: int) -> SpeakingSlot:
    """A machine's slot: its rank by node-ID among all of the site's. Raises ``ValueError`` for a node not of the site.

    Of two machines that are equally good, or nearly so, the second hears the first and stays silent: a queued frame
    cannot be recalled. So the bids of a call strictly improve on the wire (row P08), as long as no controller is late.
    """
    return SpeakingSlot(sorted(site.machines).index(node_id), len(site.machines), slot_length_us(site.bitrate))


def slot_length_us(bitrate: int) -> int:
    """One slot is as long as a bid takes to be heard by all, at a bit rate in bit/s."""
    return _FRAMES_TO_HEAR * _FRAME_BITS * 1_000_000 // bitrate + _READING_US


def in_slot(delay_us: int, slot: SpeakingSlot) -> int:
    """A delay moved within its round to the machine's own slot; rounds are short beside W: better is still sooner."""
    round_us = slot.slots * slot.length_us
    return delay_us // round_us * round_us + slot.number * slot.length_us if round_us else delay_us


def cut_off_us(deadline_us: int, timing: Timing) -> int:
    """Bids received later than this, by one's own bus time, do not count: one guard before the deadline.

    Initiator and participants use the same moment, so that they differ by no more than their clocks do.
    """
    return deadline_us - timing.deadline_guard_us


def last_bid_us(deadline_us: int, timing: Timing) -> int:
    """From this moment on no bid is sent: a second guard before the deadline, for the way to the others.

    A bid sent before it is received before the cut-off as long as bus latency and clock error together stay below one
    guard; so no bid surprises its sender by coming too late.
    """
    return deadline_us - 2 * timing.deadline_guard_us
