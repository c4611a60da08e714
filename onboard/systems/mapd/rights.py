"""Which token authorises what: one for each cell, or for each zone, which goes by its lowest cell.

It is that of a station, so that each robot's first cell is its own from the beginning; all others are with the desk at
first. Later a right goes from robot to robot: who leaves a cell passes its right on to whoever comes there next.
"""

from onboard.contract.codes import Side
from onboard.core.authority import TokenKey, station_token
from onboard.core.site import Station

_PER_SIDE = 127
_PER_TRACK = 2 * _PER_SIDE


def cell_station(resource: int) -> Station:
    """The station that stands for a cell or a zone; ``resource`` 0 to 63,999."""
    track, rest = divmod(resource, _PER_TRACK)
    return Station(track + 1, rest % _PER_SIDE + 1, Side(rest // _PER_SIDE))


def cell_token(resource: int) -> TokenKey:
    """Who holds it may be in the cell, or in any cell of the zone."""
    return station_token(cell_station(resource))


def resource_of(key: TokenKey) -> int:
    """The cell or zone that a right is about."""
    return resource_number(Station.from_number(key.number))


def resource_number(station: Station) -> int:
    """The cell or zone, from 0, that a right's station number stands for."""
    return (station.track - 1) * _PER_TRACK + station.side * _PER_SIDE + station.index - 1
