"""Serial-number arithmetic for counters and times that wrap (RFC 1982)."""

from onboard.contract.base import Stamp

#: Bus time on the wire is in milliseconds modulo this.
BUS_MS_MODULUS = 1 << 32


def is_newer(candidate: int, reference: int, bits: int) -> bool:
    """Whether ``candidate`` comes after ``reference``, counters of ``bits`` bits; False where equal or opposite."""
    distance = (candidate - reference) & ((1 << bits) - 1)
    return 0 < distance < 1 << (bits - 1)


def successor(value: int, bits: int) -> int:
    """The next counter value; 0 is left out, as it means "none" in every counter of the contract."""
    following = (value + 1) & ((1 << bits) - 1)
    return following or 1


def to_bus_ms(time_us: int) -> int:
    """Bus time in us as it goes on the wire, rounded up: a promise is never told earlier than it is."""
    return -(-time_us // 1000) % BUS_MS_MODULUS


def ms_after(bus_ms: int, other_ms: int) -> int:
    """How long after ``other_ms`` a bus time is, both in ms as on the wire: by the shorter way round, so 24.8 days.

    Every comparison of two such times is one of this with 0: they wrap after 49.7 days, and ``<`` then lies.
    """
    return away(bus_ms, other_ms, BUS_MS_MODULUS)


def ranks_before(one: Stamp, other: Stamp) -> bool:
    """Whether ``one`` plan keeps its windows before the ``other``; of two that differ always exactly one does."""
    after_ms = ms_after(one.award_ms, other.award_ms)
    if after_ms == ms_after(other.award_ms, one.award_ms):
        # The same time, or half the way round, where nobody can say which came first.
        return one < other
    return after_ms < 0


def away(value: int, other: int, modulus: int) -> int:
    """``value`` - ``other`` by the shorter way round, from -``modulus`` / 2 to one less than its half (RFC 1982)."""
    half = modulus >> 1
    return (value - other + half) % modulus - half


def from_bus_ms(bus_ms: int, near_us: int) -> int:
    """The bus time in us nearest to ``near_us`` that reads ``bus_ms`` on the wire (within 24.8 days of it)."""
    near_ms = near_us // 1000
    return (near_ms + ms_after(bus_ms, near_ms)) * 1000
