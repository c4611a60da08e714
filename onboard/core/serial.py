"""Serial-number arithmetic for counters and times that wrap (RFC 1982)."""

from collections.abc import Iterable, Mapping

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


def from_bus_ms(bus_ms: int, near_us: int) -> int:
    """The bus time in us nearest to ``near_us`` that reads ``bus_ms`` on the wire (within 24.8 days of it)."""
    near_ms = near_us // 1000
    half = BUS_MS_MODULUS >> 1
    return ((bus_ms - near_ms + half) % BUS_MS_MODULUS - half + near_ms) * 1000


def last_boot(entries: Iterable[Mapping[str, str | int]]) -> int:
    """The boot counter last journalled, 1 to 255; 0 where there is none."""
    last = 0
    for entry in entries:
        if entry.get("record") == "boot":
            last = int(entry["boot"])
    return last


def next_boot(entries: Iterable[Mapping[str, str | int]]) -> int:
    """The boot counter after the last one journalled, 1 to 255, going round."""
    return successor(last_boot(entries), 8)
