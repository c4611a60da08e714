"""Frames by the DBC files alone."""

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import cantools
from cantools.database.can import Database, Message

FOLDER = Path(__file__).parents[2] / "dbc"
#: Signals of a word about a token that make a run of it where segments are in line, and the least of which is told.
_RUNS = {"TokenGrant": "", "TokenHeld": "", "TokenRequest": "version_seen", "TokenRefusal": "version"}
_MOST_OF_RUN = 16
Signals = dict[str, Any]


class Word(NamedTuple):
    """One frame's message: its name, the sender's node-ID, its signals (choices by name)."""

    name: str
    sender: int
    signals: Signals


@cache
def database(name: str) -> Database:
    """A DBC file, "fleet" or "device"."""
    found = cantools.database.load_file(FOLDER / f"{name}.dbc")
    assert isinstance(found, Database)
    return found


@cache
def _by_name(bus: str) -> dict[str, Message]:
    return {one.name: one for one in database(bus).messages}


@cache
def by_number(bus: str) -> dict[int, Message]:
    """All messages of a DBC file by their identifier without a node-ID."""
    return {one.frame_id: one for one in database(bus).messages}


def encode(bus: str, sender: int, name: str, signals: Signals) -> tuple[int, bytes]:
    """Identifier and bytes."""
    message = _by_name(bus)[name]
    return message.frame_id | sender, message.encode(signals, strict=False)


def decode(bus: str, number: int, data: bytes) -> Word | None:
    """The word of a frame; None for one that the DBC does not have (duties F2, F3)."""
    message = by_number(bus).get(number & ~0xFF)
    if message is None or not number & 0xFF or len(data) < message.length:
        return None
    found = message.decode(data)
    assert isinstance(found, dict)
    signals = {key: value if isinstance(value, int | float) else str(value) for key, value in found.items()}
    return Word(message.name, number & 0xFF, signals)


def singles(word: Word) -> list[Word]:
    """A run taken apart (duty F8)."""
    if word.signals.get("token_kind") != "RUN":
        return [word]
    number = word.signals["token"]
    track, first, last = number >> 16, number >> 8 & 0xFF, number & 0xFF
    if abs(last - first) >= _MOST_OF_RUN:
        return []
    step = 1 if last >= first else -1
    indices = range(first, last + step, step)
    return [word._replace(signals={**word.signals, "token_kind": "SEGMENT", "token": track << 8 | i}) for i in indices]


def joined(words: list[tuple[str, Signals]]) -> list[tuple[str, Signals]]:
    """Words about segments in line that say the same as one run."""
    runs: list[list[tuple[str, Signals]]] = []
    for word in words:
        if runs and _goes_on(runs[-1], word):
            runs[-1].append(word)
        else:
            runs.append([word])
    return [_run(run) for run in runs]


def _goes_on(run: list[tuple[str, Signals]], word: tuple[str, Signals]) -> bool:
    (name, last), (other, signals) = run[-1], word
    if name != other or name not in _RUNS or {last["token_kind"], signals["token_kind"]} != {"SEGMENT"}:
        return False
    step = signals["token"] - last["token"]
    is_line = abs(step) == 1 and (len(run) == 1 or step == last["token"] - run[-2][1]["token"])
    apart = {"token", _RUNS[name]}
    same = all(signals[key] == value for key, value in last.items() if key not in apart)
    return is_line and same and len(run) < _MOST_OF_RUN and signals["token"] >> 8 == last["token"] >> 8


def _run(run: list[tuple[str, Signals]]) -> tuple[str, Signals]:
    name, first = run[0]
    if len(run) == 1:
        return name, first
    track, begin, end = first["token"] >> 8, first["token"] & 0xFF, run[-1][1]["token"] & 0xFF
    signals = {**first, "token_kind": "RUN", "token": track << 16 | begin << 8 | end}
    least = _RUNS[name]
    return name, {**signals, least: min(one[least] for _, one in run)} if least else signals
