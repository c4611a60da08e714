"""Runs: one word about the tokens of segments in line, which is as good as one for each of them (docs/protocol.md).

Nobody behind the wire knows runs: who hears one takes it apart, and who says several words joins what can be one.
Whatever is proved of words about one token holds of runs: the bus loses, doubles or delays these words together.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from onboard.contract.base import Message
from onboard.contract.codes import TokenKind
from onboard.contract.constants import SEEN_VERSION_BITS
from onboard.contract.rights import TokenGrant, TokenHeld, TokenRefusal, TokenRequest

#: Most segments of a run (dbc/fleet.dbc): each is written to a journal before the word goes out.
MOST_OF_RUN = 16
#: Versions farther apart are not one run (rule 4 of the protocol's review): far below half of ``SEEN_VERSION_BITS``.
MOST_SPREAD = 1 << 14
#: Words that are joined, and the field in which a run tells the least of its versions.
_JOINED: dict[type[Message], str] = {
    TokenGrant: "",
    TokenHeld: "",
    TokenRefusal: "version",
    TokenRequest: "version_seen",
}
#: What ``_token_fields`` has found, one row a class.
_FIELDS: dict[type[Message], tuple[int, int] | None] = {}


def singles(message: Message) -> Sequence[Message]:
    """The words for which this one stands: itself, or one for each segment of a run in its order; none of a bad run."""
    word: Any = message
    try:
        at = _FIELDS[type(message)]
    except KeyError:
        at = _token_fields(type(message))
    if at is None or word.token_kind is not TokenKind.RUN:
        return (message,)
    track, first, last = word.token >> 16, word.token >> 8 & 0xFF, word.token & 0xFF
    if abs(last - first) >= MOST_OF_RUN:
        return ()
    step = 1 if last >= first else -1
    kind, values, (at_kind, at_token) = type(word), list(word.values_of(word)), at
    values[at_kind] = TokenKind.SEGMENT
    found = []
    for index in range(first, last + step, step):
        values[at_token] = track << 8 | index
        found.append(kind(*values))
    return found


def _token_fields(kind: type[Message]) -> tuple[int, int] | None:
    """Where messages of a class name a token among their fields: its kind and its number; None where they do not."""
    names = kind.__match_args__
    _FIELDS[kind] = (names.index("token_kind"), names.index("token")) if "token_kind" in names else None
    return _FIELDS[kind]


def is_joined(message: Message) -> bool:
    """Whether a word may become part of a run."""
    return type(message) in _JOINED and getattr(message, "token_kind", None) is TokenKind.SEGMENT


def joined(words: Sequence[Message]) -> list[Message]:
    """The same said in as few words as can be, in the same order; each of them ``is_joined``."""
    runs: list[list[Any]] = []
    for word in words:
        if runs and _goes_on(runs[-1], word):
            runs[-1].append(word)
        else:
            runs.append([word])
    return [_word(run) for run in runs]


def _goes_on(run: list[Any], word: Any) -> bool:
    """Whether ``word`` says the same as those of ``run`` of the next segment in line."""
    last, seen = run[-1], _JOINED[type(run[0])]
    if type(word) is not type(last) or len(run) == MOST_OF_RUN or word.token >> 8 != last.token >> 8:
        return False
    step = word.token - last.token
    if abs(step) != 1 or (len(run) > 1 and step != last.token - run[-2].token):
        return False
    if seen and any(abs(_later(getattr(word, seen), getattr(one, seen))) >= MOST_SPREAD for one in run):
        return False
    same = {seen: getattr(word, seen)} if seen else {}
    return bool(word == replace(last, token=word.token, **same))


def _word(run: list[Any]) -> Message:
    first, seen = run[0], _JOINED[type(run[0])]
    token = first.token >> 8 << 16 | (first.token & 0xFF) << 8 | run[-1].token & 0xFF
    told: dict[str, Any] = {} if len(run) == 1 else {"token_kind": TokenKind.RUN, "token": token}
    if seen:
        versions = [getattr(one, seen) for one in run]
        told[seen] = min(versions, key=lambda version: _later(version, versions[0]))
    word: Message = replace(first, **told)
    return word


def _later(version: int, other: int) -> int:
    """How far one told version is after another, serial numbers both."""
    half = 1 << SEEN_VERSION_BITS - 1
    return (version - other + half) % (2 * half) - half
