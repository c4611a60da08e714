"""Which tokens a site has, and who holds each before it first moves."""

from functools import cache
from typing import NamedTuple

from onboard.contract.codes import TokenKind
from onboard.core.site import Segment, Site, Station


class TokenKey(NamedTuple):
    """Which token: its kind and 24-bit number."""

    kind: TokenKind
    number: int


@cache
def segment_token(segment: Segment) -> TokenKey:
    """The token of one body slot: always the same, so each is made once, 65,536 at most."""
    return TokenKey(TokenKind.SEGMENT, segment.number)


def station_token(station: Station) -> TokenKey:
    """The token of one station: who holds it may reach into it."""
    return TokenKey(TokenKind.STATION, station.number)


def genesis_holder(site: Site, key: tuple[TokenKind, int]) -> int:
    """Who holds a token before it first moves, by the site file alone.

    A robot holds the segment of its home, a fixed machine its station; the track's steward holds all other segments and
    stations. All else is made by its origin node.
    """
    kind, number = key
    if (first := site.at_first.get(kind)) is None:
        return number >> 16
    holder = first.get(number)
    return site.stewards.get(number >> 8, 0) if holder is None else holder


def may_exist(site: Site, key: tuple[TokenKind, int]) -> bool:
    """Whether the site has such a token, so that no frame can fill the book with what nobody ever made."""
    return genesis_holder(site, key) in site.machines
