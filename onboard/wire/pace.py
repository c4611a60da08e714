"""How often a machine may say what is not urgent: budgets that its outgoing queue keeps to, and bounds start from.

A budget is a share of the bus, divided by the machines of the site that say such a thing: so all machines together keep
to it, whatever their programs want to say, at any bit rate. What no row is for is limited by what it is about (one call
of a desk, one answer to a request): ``traffic.py`` of a system says by what.
"""

from dataclasses import dataclass

from onboard.contract.codes import KindCode
from onboard.contract.constants import MOBILE_KINDS
from onboard.core.site import Site

#: A sign of life waits no longer than this for plans, us: half a period, and a machine is silent after three.
HELD_US = 1_000_000
_SECOND_US = 1_000_000
#: The longest frame of the fleet bus with stuff bits and intermission (Davis, Burns, Bril, Lukkien 2007), bit times.
_FRAME_BITS = 160


@dataclass(frozen=True, slots=True)
class Pace:
    """At most ``burst`` frames at once, then one each ``apart_us``; what is not used adds up to ``burst`` again."""

    burst: int
    apart_us: int


@dataclass(frozen=True, slots=True)
class Share:
    """Of one message: ``parts`` per thousand of the bus for all machines together in the long run.

    ``at_once_us``: bus time for what all may say at one instant; but each ``least`` frames, and no more than ``most``.
    ``who``: the kinds of machines among which it is divided; none for all.
    """

    parts: int
    at_once_us: int
    least: int
    most: int
    who: frozenset[KindCode] = frozenset()

    def among(self, site: Site) -> int:
        """How many machines of a site it is divided by, 1 at least."""
        return max(1, sum(not self.who or machine.kind in self.who for machine in site.machines.values()))


#: ``least``: rights for one stopping distance, heads of two itineraries, legs of a way over two floors, a heartbeat at
#: its time and two after own words, two reasons. ``most``: seven rights said twice, heads of four itineraries and
#: the legs of two, the heartbeats of a start, four reasons. Two thirds of the bus and more are left to what has none.
SHARES: dict[str, Share] = {
    "TokenRequest": Share(40, 150_000, 4, 14),
    "ItineraryHead": Share(30, 60_000, 2, 4, MOBILE_KINDS),
    "ItineraryLeg": Share(160, 250_000, 8, 62, MOBILE_KINDS),
    "Heartbeat": Share(50, 100_000, 3, 4),
    "Diagnostic": Share(10, 60_000, 2, 4),
}


def paces_of(site: Site) -> dict[str, Pace]:
    """The budget of one machine of a site, by the names of the messages that have one."""
    return {name: _pace(share, site.bitrate, share.among(site)) for name, share in SHARES.items()}


def _pace(share: Share, bit_rate: int, machines: int) -> Pace:
    at_once = share.at_once_us * bit_rate // (_SECOND_US * _FRAME_BITS * machines)
    # Rounded up: never more than the share.
    apart_us = -(-_SECOND_US * _FRAME_BITS * machines * 1_000 // (bit_rate * share.parts))
    return Pace(min(share.most, max(share.least, at_once)), apart_us)
