"""What was heard of one node: its number, and the frames that wait for their seal."""

from collections import deque
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import combinations

from onboard.contract.messages import Heartbeat
from onboard.core.frame import Frame
from onboard.seal.sender import MOST_SEALED
from onboard.seal.subjects import UNSEALED_FOR_US, CarPlaces, life_told
from onboard.seal.tags import bytes_of

#: Most frames of one node that wait for a seal: those of one, and what others may say between them in its name.
MOST_WAITING = 2 * MOST_SEALED
#: So long a frame waits for its seal, us; they are said together, but a bus can be busy.
WAITS_US = 500_000
#: After so long without any seal of a node its signs of life do not count unsealed: two seals may be lost, us.
UNHEARD_US = 5 * UNSEALED_FOR_US // 2
#: Frames of one node that may be another's twins of those before them, where a seal is over none of the usual ones.
_MOST_TWINS = 6
#: That is tried for so many seals in this time, us, whoever they are of: false seals shall not keep a board busy. One
#: takes up to 0.6 ms here, so this is at most a fortieth of the time, and a fourth on a board ten times slower.
MOST_TWIN_SEALS, TWIN_SEALS_US = 4, 100_000
#: Challenges of mine that a node may still answer.
_NONCES = 3


@dataclass(slots=True)
class WaitingFrame:
    """A frame that waits for its seal. ``is_done`` where it was handed on already, and only counts for the tag.

    ``needs_my_key`` until the seal under the key of its sender and me is there: I act on it.
    """

    frame: Frame
    since_us: int
    is_done: bool
    needs_my_key: bool = False
    #: What of it goes into a tag: a seal that does not fit is tried over many frames.
    said: bytes = field(init=False)

    def __post_init__(self) -> None:
        self.said = bytes_of(self.frame)


@dataclass(slots=True)
class HeardNode:
    """One node as a receiver knows it. ``last`` is the newest number that it proved, None before the first."""

    last: int | None = None
    #: The newest that it proved under the key of us two, which nobody else of the group could have pushed up.
    own_last: int = 0
    waiting: deque[WaitingFrame] = field(default_factory=deque)
    nonces: deque[int] = field(default_factory=lambda: deque(maxlen=_NONCES))
    answer: Frame | None = None
    #: The number that it told somebody last, proved or not; None before the first.
    claim: int | None = None
    #: With which nonce it challenged me last, or all; None before the first.
    asked: int | None = None
    #: Its last sign of life that counted without a seal.
    free: WaitingFrame | None = None
    places: CarPlaces = field(default_factory=CarPlaces)
    #: Seals in a row that did not fit, and when it may be challenged next, us.
    misfits: int = 0
    ask_us: int = 0
    patience_us: int = 0
    _told: tuple[int, ...] = ()
    _sealed_us: int = 0

    def proved(self, number: int, now_us: int) -> None:
        """A seal under ``number`` was good."""
        if self.last is not None and self.last >> 32 != number >> 32:
            self.places.forget()
        self.last, self.misfits, self._sealed_us = number, 0, now_us

    def told(self, beat: Heartbeat) -> None:
        """A sealed sign of life: the next ones that say the same count without a seal."""
        self._told = life_told(beat)

    def needs_no_seal(self, beat: Heartbeat, now_us: int) -> bool:
        """Whether a sign of life says what the last sealed one did, of a node that has sealed something of late."""
        return self.last is not None and life_told(beat) == self._told and now_us - self._sealed_us <= UNHEARD_US


def readings(waiting: Sequence[WaitingFrame]) -> Iterator[Sequence[WaitingFrame]]:
    """What a seal may be over: all that waits; the earlier ones, where others spoke before the seal; the later ones.

    Then all but one in between. None of more than ``MOST_SEALED`` frames, so at most 23 sequences.
    """
    whole = len(waiting)
    if 0 < whole <= MOST_SEALED:
        yield waiting
    for at in range(1, whole):
        if at <= MOST_SEALED:
            yield waiting[:at]
        if whole - at <= MOST_SEALED:
            yield waiting[at:]
    if whole <= MOST_SEALED + 1:
        for left_out in range(1, whole - 1):
            yield [*waiting[:left_out], *waiting[left_out + 1 :]]


def readings_among_twins(waiting: Sequence[WaitingFrame]) -> Iterator[Sequence[WaitingFrame]]:
    """What a seal may be over where others spoke more than once before it, in its sender's name.

    First without those that say anew what one of the two before them said, which is what they are that flip a bit or
    repeat; then of the last ones, as those of before may wait for nothing, without any one or two. At most 63 and 202
    sequences, none of more than ``MOST_SEALED`` frames.
    """
    whole = len(waiting)
    identifiers = [one.frame.arbitration_id for one in waiting]
    again = [at for at in range(1, whole) if identifiers[at] in identifiers[max(0, at - 2) : at]][:_MOST_TWINS]
    for count in range(len(again), 0, -1):
        if whole - count <= MOST_SEALED:
            yield from (_without(waiting, left_out) for left_out in combinations(again, count))
    for first in range(max(0, whole - MOST_SEALED - 2), whole - 1):
        for count in (1, 2):
            if count < whole - first <= MOST_SEALED + count:
                yield from (
                    _without(waiting[first:], left_out) for left_out in combinations(range(whole - first), count)
                )


def _without(waiting: Sequence[WaitingFrame], left_out: Collection[int]) -> Sequence[WaitingFrame]:
    return [one for at, one in enumerate(waiting) if at not in left_out]
