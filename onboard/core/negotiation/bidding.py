"""When to speak and which bid is better: the two rules that keep the bus quiet."""

from onboard.core.codes import Criterion
from onboard.core.serial import BUS_MS_MODULUS
from onboard.core.site import Timing

_HALF = BUS_MS_MODULUS >> 1


def cost_difference(cost: int, other: int, criterion: Criterion) -> int:
    """``cost - other`` in the criterion's unit; finishing times wrap (RFC 1982), money and length do not."""
    if criterion is Criterion.FINISH_TIME:
        return (cost - other + _HALF) % BUS_MS_MODULUS - _HALF
    return cost - other


def beats(cost: int, node: int, other_cost: int, other_node: int, criterion: Criterion) -> bool:
    """Whether a bid is better than another: lower cost, then lower node-ID (decision on flag 10)."""
    difference = cost_difference(cost, other_cost, criterion)
    return difference < 0 or (difference == 0 and node < other_node)


def delay_us(cost: int, floor: int, criterion: Criterion, timing: Timing) -> int:
    """How long a bidder waits before it speaks: W x / (x + h), x its cost above the floor (design, section 4).

    Better bids speak sooner; W is ``bid_delay_us``, h ``bid_half_us``. x is in us for a finishing time, else in the
    criterion's unit times 1000, so that one site constant h serves a time of 10 s and a price of 100 alike.
    """
    above = max(0, cost_difference(cost, floor, criterion)) * 1000
    return timing.bid_delay_us * above // (above + timing.bid_half_us)
