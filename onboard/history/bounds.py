"""Memory that stays bounded, so that whoever listens may listen for ever."""

from collections.abc import Callable
from typing import TypeVar

_Key = TypeVar("_Key")
_Record = TypeVar("_Record")


def drop_oldest(records: dict[_Key, _Record], most: int, is_over: Callable[[_Record], bool]) -> _Record | None:
    """Drop the oldest that is over, else the oldest, where there are more than ``most``; what was dropped, if any."""
    if len(records) <= most:
        return None
    return records.pop(next((key for key, record in records.items() if is_over(record)), next(iter(records))))
