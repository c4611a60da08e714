"""A recorded log as a film: it can be shown from any moment on, and its length does not matter.

Reading folds the log once. Its frames go into a file without a name, in records of one length, so that nothing has to
be parsed twice; now and then the whole picture is kept as a key frame. A moment is then the last key frame before it
and the frames in between. Key frames thin out as the log grows, so there are never more than a few dozen.
"""

import copy
from collections.abc import Iterable, Iterator
from struct import Struct
from tempfile import TemporaryFile
from typing import BinaryIO, NamedTuple, Self

from onboard.contract.runs import singles
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.seal.keys import Keys
from onboard.trace.listener import Listener
from onboard.trace.raw import RawFrame
from onboard.web.picture import LivePicture, marks_of
from onboard.wire.codec import Codecs

#: Time us, identifier, channel, kind bits, data length, data.
_RECORD = Struct("<qIHBB8s")
_EXTENDED, _REMOTE, _ERROR = 1, 2, 4
#: Records read at once.
_BLOCK = 2048
#: Frames between key frames at first, and most key frames: then every other goes.
KEY_EVERY, MOST_KEYS = 8_192, 32


class _FilmState(NamedTuple):
    """Everything after so many frames."""

    picture: LivePicture
    listener: Listener


class Film:
    """Read it once with ``read``; then ``show(time_us)`` gives the picture of a moment. ``close`` frees the file."""

    def __init__(self, site: Site, codecs: Codecs, keys: Keys | None = None) -> None:
        """``keys``: of any node, for whose seals are right."""
        self.site = site
        self._codecs, self._seal_keys = codecs, keys
        self._file: BinaryIO = TemporaryFile(prefix="onboard-web-")  # noqa: SIM115  # closed by close()
        self._channels: list[str] = []
        self._count = 0
        self._keys: list[tuple[int, int, _FilmState]] = []
        self._every = KEY_EVERY
        self._state = self._empty()
        self._next = 0
        self._messages = 0
        self.first_us = self.last_us = 0

    def _empty(self) -> _FilmState:
        marks = marks_of(self.site, self._codecs, self._seal_keys)
        return _FilmState(LivePicture(self.site, marks), Listener(self._codecs))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free what is on the disk."""
        self._file.close()

    # --- reading -----------------------------------------------------------------------------------------------

    def read(self, frames: Iterable[RawFrame]) -> None:
        """Take up a whole log. Raises ``ValueError`` where nothing in it is a message of the site's fleet bus.

        A clock that was set back while the log was written must not hide what came after: time stands still then.
        """
        now_us, is_begun = 0, False
        for raw in frames:
            classic = raw.classic()
            if classic is None:
                continue
            if self._count % self._every == 0:
                self._keep(now_us)
            now_us = max(now_us, raw.time_us) if is_begun else raw.time_us
            self._write(now_us, raw.channel, classic)
            if self._feed(raw._replace(time_us=now_us), classic) and not is_begun:
                is_begun, self.first_us = True, now_us
            self.last_us = now_us
        if not is_begun:
            raise ValueError("no message of the site's fleet bus is in it")
        self._next = self._count

    def _write(self, time_us: int, channel: str, frame: Frame) -> None:
        if channel not in self._channels:
            self._channels.append(channel)
        kind = _EXTENDED * frame.is_extended | _REMOTE * frame.is_remote | _ERROR * frame.is_error
        number = min(self._channels.index(channel), 0xFFFF)
        self._file.write(_RECORD.pack(time_us, frame.arbitration_id, number, kind, frame.dlc, frame.data))
        self._count += 1

    def _keep(self, time_us: int) -> None:
        """One key frame more, of everything before the next frame."""
        self._keys.append((self._count, time_us, self._copy(self._state)))
        if len(self._keys) > MOST_KEYS:
            self._every *= 2
            self._keys = [key for key in self._keys if key[0] % self._every == 0]

    def _copy(self, state: _FilmState) -> _FilmState:
        """A copy that shares what never changes."""
        fixed = (self.site, self._codecs, self._codecs.fleet, self._codecs.device)
        return copy.deepcopy(state, {id(one): one for one in fixed})

    def _feed(self, raw: RawFrame, classic: Frame) -> bool:
        """Whether it ended a message of the fleet bus."""
        picture, listener = self._state
        heard = listener.hear(raw)
        if heard.is_fleet or classic.is_error:
            picture.count_frame(classic)
            picture.mark_frame(classic, raw.time_us)
        if heard.message is None:
            return False
        if heard.is_fleet:
            for word in singles(heard.message):
                picture.feed(word, raw.time_us)
        else:
            picture.feed_device(heard.message.sender, heard.message, raw.time_us)
        return heard.is_fleet

    # --- showing -----------------------------------------------------------------------------------------------

    def show(self, time_us: int) -> LivePicture:
        """The picture with all frames up to a moment, and its clock there. Forward from the last one is cheap."""
        picture = self._state.picture
        if time_us < picture.view.now_us or self._is_key_ahead(time_us):
            self._next, _, state = next(key for key in reversed(self._keys) if key[1] <= time_us or key[0] == 0)
            self._state = self._copy(state)
        for raw, classic in self._frames(self._next):
            if raw.time_us > time_us:
                break
            self._next += 1
            self._feed(raw, classic)
        self._state.picture.view.now_us = time_us
        return self._state.picture

    def _is_key_ahead(self, time_us: int) -> bool:
        return any(self._next < number and at_us <= time_us for number, at_us, _ in self._keys)

    def _frames(self, first: int) -> Iterator[tuple[RawFrame, Frame]]:
        while first < self._count:
            self._file.seek(first * _RECORD.size)
            block = self._file.read(_RECORD.size * min(_BLOCK, self._count - first))
            for time_us, identifier, channel, kind, length, data in _RECORD.iter_unpack(block):
                is_remote = bool(kind & _REMOTE)
                frame = Frame(
                    identifier,
                    b"" if is_remote else data[:length],
                    bool(kind & _EXTENDED),
                    is_remote,
                    bool(kind & _ERROR),
                    length if is_remote else 0,
                )
                name = self._channels[channel]
                yield RawFrame(time_us, name, *frame[:5], remote_dlc=frame.remote_dlc), frame
            first += _BLOCK
