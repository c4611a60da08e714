"""Filters in candump's words: ``can0,123:7FF,400~700,#FFFFFFFF``; the kernel's rule decides (net/can/af_can.c)."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.trace.raw import EFF_FLAG, ERR_FLAG, RawFrame

_FILTER = re.compile(r"([0-9A-Fa-f]{1,8})([:~])([0-9A-Fa-f]{1,8})")
_ERROR_MASK = re.compile(r"#([0-9A-Fa-f]{1,8})")
_JOIN = ("j", "J")
#: Error classes that are let through where error frames are asked for as a whole (``CAN_ERR_MASK``).
ALL_ERRORS = 0x1FFF_FFFF
#: The interface name that means all of them.
ANY = "any"
_LONG = 8


class FilterError(ValueError):
    """A filter that candump would not understand; the text says which and how filters are written."""


@dataclass
class FilterSet:
    """One interface with its filters. A data frame passes if any filter matches, or all where they are joined."""

    channel: str = ANY
    #: Identifier, mask and whether it is the frames that do *not* match that pass.
    filters: list[tuple[int, int, bool]] = field(default_factory=list)
    error_mask: int = 0
    joined: bool = False

    def passes(self, frame: RawFrame) -> bool:
        """Whether this set lets a frame through."""
        if self.channel not in (ANY, frame.channel):
            return False
        if frame.is_error:
            return bool(frame.can_id & self.error_mask)
        if not self.filters:
            return True
        seen = frame.socketcan_id
        matches = (((seen & mask) == (wanted & mask)) is not inverse for wanted, mask, inverse in self.filters)
        return all(matches) if self.joined else any(matches)


def parse_filters(words: Iterable[str], *, errors: bool = False) -> list[FilterSet]:
    """One set for each word ``[INTERFACE][,FILTER]*``; none means everything. Raises ``FilterError``.

    ``errors`` lets all error frames through every set that has no error mask of its own.
    """
    sets = [_parse_set(word) for word in words] or [FilterSet()]
    for one in sets:
        if errors and not one.error_mask:
            one.error_mask = ALL_ERRORS
    return sets


def _parse_set(word: str) -> FilterSet:
    found = FilterSet()
    parts = word.split(",")
    if not _is_filter(parts[0]):
        found.channel = parts.pop(0)
    for part in parts:
        if match := _FILTER.fullmatch(part):
            wanted, sign, mask = match.groups()
            # An identifier of 8 digits is a 29-bit one; whether that must be so, the mask says (candump.c).
            flag = EFF_FLAG if len(wanted) == _LONG else 0
            found.filters.append((int(wanted, 16) | flag, int(mask, 16) & ~ERR_FLAG, sign == "~"))
        elif match := _ERROR_MASK.fullmatch(part):
            found.error_mask = int(match[1], 16)
        elif part in _JOIN:
            found.joined = True
        else:
            raise FilterError(
                f"filter {part!r} in {word!r}: write ID:MASK, ID~MASK or #ERRORMASK in hexadecimal, such as 123:7FF"
            )
    return found


def _is_filter(part: str) -> bool:
    return bool(_FILTER.fullmatch(part) or _ERROR_MASK.fullmatch(part)) or part in _JOIN or "#" in part or ":" in part
