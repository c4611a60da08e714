"""Which token authorises what on a graph, and who keeps it while nobody needs it.

An edge's token is that of segment (lower end, higher end); a slot's that of station (node, slot). Both are with the
host of the (lower) node's agent at first, but for the slots in which robots stand.
"""

from onboard.contract.codes import Side
from onboard.core.authority import TokenKey, segment_token, station_token
from onboard.core.site import Segment, Station
from onboard.systems.graph.network import edge
from onboard.systems.graph.site import FactoryGraph


def edge_segment(one: int, other: int) -> Segment:
    """The segment that stands for an edge."""
    return Segment(*edge(one, other))


def edge_token(one: int, other: int) -> TokenKey:
    """Who holds it may be on the edge (row G08)."""
    return segment_token(edge_segment(one, other))


def slot_token(node: int, slot: int) -> TokenKey:
    """Who holds it may stand in the slot; slots count from 1."""
    return station_token(Station(node, slot, Side.NEAR))


def keeper(site: FactoryGraph, key: TokenKey) -> int:
    """The host to which a right goes back."""
    return site.hosts.get(key.number >> 8, 0)
