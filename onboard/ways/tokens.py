"""Names of tokens where machines move along ways: slots, places, and what stands there."""

from collections.abc import Iterable

from onboard.contract.codes import TokenKind
from onboard.core.site import Segment
from onboard.core.token_keys import TokenKey, segment_token, station_token
from onboard.ways.lifts import GATE_INDEX, PLATFORM_INDEX
from onboard.ways.site import TrackKind, WaySite


def car_token(origin: int, number: int) -> TokenKey:
    """The token of one car: its holder is the custodian."""
    return TokenKey(TokenKind.CAR, origin << 16 | number)


def site_slots(site: WaySite) -> Iterable[Segment]:
    """All body slots of a site, in the order of its tracks; of a lift its platform and its gate."""
    for number, track in site.tracks.items():
        if track.kind is TrackKind.LIFT:
            yield from (Segment(number, PLATFORM_INDEX), Segment(number, GATE_INDEX))
        else:
            yield from (Segment(number, index) for index in range(1, track.length + 1))


def tokens_of(site: WaySite) -> Iterable[TokenKey]:
    """All tokens of segments and stations that a site has."""
    yield from (segment_token(slot) for slot in site_slots(site))
    yield from (station_token(place) for place in site.places)
    yield from (station_token(bay) for bay in site.compartments.values())
