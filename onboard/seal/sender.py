"""What one node says, with its seals behind it."""

from onboard.contract.constants import NOBODY
from onboard.contract.messages import BusTime, EmergencyStop, Heartbeat
from onboard.contract.seal import Seal, SealAnswer, SealTo
from onboard.core.frame import Frame
from onboard.seal.keys import Keys
from onboard.seal.subjects import UNSEALED_FOR_US, CarPlaces, Reading, frame_of, life_told, taker_of
from onboard.seal.tags import tag_of

#: Most frames under one seal: an itinerary of seven legs.
MOST_SEALED = 8
#: A sign of life that says something new is sealed so often: one seal may be lost.
_BEATS_SEALED = 2
_LOW = 0xFFFF


class SealingSender:
    """Numbers and seals what goes out. ``life`` is greater at each start of this node: no number is used twice.

    One number serves all keys. Its upper 32 bits are the life, so nothing is written down for a frame.
    """

    def __init__(self, keys: Keys, life: int, reading: Reading) -> None:
        self.number = life << 32
        self._keys, self._reading = keys, reading
        self._unsealed: list[Frame] = []
        self._places = CarPlaces()
        self._told: tuple[int, ...] = ()
        self._beats_to_seal = 0
        self._sealed_us = 0

    @property
    def waits(self) -> bool:
        """Whether something was said that no seal is behind yet."""
        return bool(self._unsealed)

    def say(self, frame: Frame, now_us: int) -> list[Frame]:
        """What goes on the bus for one frame: seals before it, the frame, and seals behind it."""
        word = self._reading(frame)
        if isinstance(word, Heartbeat):
            # Receivers need not know whether it is among what is sealed: it stands alone.
            return [*self.seal(now_us), frame, *self._behind_beat(word, frame, now_us)]
        said = [frame]
        taker = taker_of(word)
        if taker in self._keys.pairs:
            covered = self._places.with_grant(word, frame)
            # The taker must have taken up where the car stands.
            said = [*self.seal(now_us), frame] if len(covered) > 1 else said
            said.append(frame_of(SealTo(self._keys.node, *self._next(self._keys.pairs[taker], covered, taker))))
        self._places.note(word, frame)
        self._unsealed.append(frame)
        # The fewer frames under one seal, the less does who speaks in between; and a clock does not wait.
        is_urgent = taker in self._keys.pairs or isinstance(word, BusTime | EmergencyStop)
        return said + (self.seal(now_us) if is_urgent or len(self._unsealed) >= MOST_SEALED else [])

    def seal(self, now_us: int) -> list[Frame]:
        """The seal of all that was said since the last one; nothing where that is nothing."""
        if not self._unsealed:
            return []
        frames, self._unsealed, self._sealed_us = self._unsealed, [], now_us
        return [frame_of(Seal(self._keys.node, *self._next(self._keys.group, frames, NOBODY)))]

    def answer(self, whom: int, nonce: int, now_us: int) -> list[Frame]:
        """Tell ``whom`` the number, proved by its nonce. Nothing for a node without a key."""
        key = self._keys.pairs.get(whom)
        if key is None:
            return []
        before = self.seal(now_us)
        # Who begins to follow me knows no sign of life of mine.
        self._beats_to_seal = _BEATS_SEALED
        self.number += 1
        answer = frame_of(SealAnswer(self._keys.node, self.number & 0xFFFFFFFF, self.number >> 32))
        tag = tag_of(key, self.number, (answer,), whom, nonce)
        return [*before, answer, frame_of(SealTo(self._keys.node, self.number & _LOW, tag))]

    def _behind_beat(self, beat: Heartbeat, frame: Frame, now_us: int) -> list[Frame]:
        """Nothing behind a sign of life that says what the last sealed ones did, while any seal was said of late."""
        told = life_told(beat)
        if told != self._told:
            self._told, self._beats_to_seal = told, _BEATS_SEALED
        if not self._beats_to_seal and now_us - self._sealed_us < UNSEALED_FOR_US:
            return []
        self._beats_to_seal = max(0, self._beats_to_seal - 1)
        self._unsealed.append(frame)
        return self.seal(now_us)

    def _next(self, key: bytes, frames: "list[Frame] | tuple[Frame, ...]", taker: int) -> tuple[int, int]:
        self.number += 1
        return self.number & _LOW, tag_of(key, self.number, frames, taker)
