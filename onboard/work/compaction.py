"""Compaction: which journal records still mean something, by the rules of their types. Entries in, fewer entries out.

What is left is a part of what was there, in the same order, so whoever replays it comes to the same state (the tests
say so for every system). A type that nobody knows is kept for good, and so is what has not the form of its type.
"""

from collections.abc import Iterable, Mapping

from onboard.core.journal_records import (
    Entry,
    JournalRecord,
    Keep,
    RecordShapeError,
    RecordTypes,
    Which,
    by_name,
    read_record,
)
from onboard.core.records import CORE_RECORDS, TokenGoneRecord, TokenRecord
from onboard.core.serial import is_newer

#: A car whose token was confirmed away, and after which so many newer ones of its origin came, is forgotten even where
#: its leaving was never heard (a machine that was off): its number comes again after 65,535.
NUMBERS_KEPT = 1_024
_NUMBER_BITS = 16

_Group = tuple[str, tuple[object, ...]]
#: A type of its own for each record that nobody knows: nothing supersedes it.
_UNKNOWN = (Keep("unknown", which=Which.ALL),)


def compact(types: RecordTypes, entries: Iterable[Entry]) -> list[Entry]:
    """Those of ``entries`` (oldest first) that still mean something, in their order. ``types``: beside the core's."""
    entries = list(entries)
    known = by_name(*CORE_RECORDS, *types)
    records = [_known(known, entry) for entry in entries]
    forgotten = _forgotten_loads(records)
    alive: dict[_Group, list[int]] = {}
    over: dict[str, dict[_Group, None]] = {}
    for index, record in enumerate(records):
        if record is not None and record.load_number() in forgotten:
            continue
        for rule in _UNKNOWN if record is None else record.RULES:
            key = tuple(getattr(record, name) for name in rule.key)
            if isinstance(rule, Keep):
                _keep(alive.setdefault((rule.family, key), []), index, rule.which)
                over.get(rule.family, {}).pop((rule.family, key), None)
            elif rule.when is None or getattr(record, rule.when[0]) in rule.when[1]:
                for family in rule.families:
                    _end(alive, over.setdefault(family, {}), (family, key), rule.most)
    kept = {index for group in alive.values() for index in group}
    return [entry for index, entry in enumerate(entries) if index in kept]


def _known(known: Mapping[str, type[JournalRecord]], entry: Entry) -> JournalRecord | None:
    try:
        return read_record(known, entry)
    except RecordShapeError:
        return None


def _keep(group: list[int], index: int, which: Which) -> None:
    if which is Which.NEWEST:
        group.clear()
    elif which is Which.FIRST_AND_NEWEST:
        del group[1:]
    group.append(index)


def _end(alive: dict[_Group, list[int]], over: dict[_Group, None], group: _Group, most: int) -> None:
    over.pop(group, None)
    over[group] = None
    while len(over) > most:
        oldest = next(iter(over))
        del over[oldest]
        alive.pop(oldest, None)


def _forgotten_loads(records: Iterable[JournalRecord | None]) -> set[int]:
    """Loads that were confirmed away and are older than ``NUMBERS_KEPT`` others of their origin."""
    last: dict[int, TokenRecord] = {}
    newest: dict[int, int] = {}
    for record in records:
        load = record.load_number() if record is not None else None
        if record is None or load is None:
            continue
        origin, number = divmod(load, 1 << _NUMBER_BITS)
        if isinstance(record, TokenRecord):
            last[load] = record
        if origin not in newest or is_newer(number, newest[origin], _NUMBER_BITS):
            newest[origin] = number

    def is_old(load: int) -> bool:
        origin, number = divmod(load, 1 << _NUMBER_BITS)
        return is_newer((newest[origin] - NUMBERS_KEPT) % (1 << _NUMBER_BITS), number, _NUMBER_BITS)

    return {load for load, record in last.items() if isinstance(record, TokenGoneRecord) and is_old(load)}
