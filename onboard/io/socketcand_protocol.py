"""The socketcand protocol in bytes: what client and server share.

Source: ``doc/protocol.md`` of github.com/linux-can/socketcand. Messages are ``< words >`` in ASCII without line ends;
TCP cuts and joins them anywhere. Raw mode knows data frames only: the daemon itself drops remote frames on their way to
a client, and so do we.
"""

import re

from onboard.core.frame import CAN_EFF_MASK, CAN_MAX_DLC, CAN_SFF_MASK, Frame

DEFAULT_PORT = 29536
#: Longest message that is waited for, bytes. The longest of the protocol that concerns us has 68.
MESSAGE_LIMIT = 512

_FLAG_EXTENDED = 1 << 31
_FLAGS_OTHER = 3 << 29
_SEND_FIELDS = 3
_FRAME_FIELDS = 3


class Splitter:
    """Cuts a TCP stream into messages. ``garbage`` counts pieces between messages that belong to none."""

    def __init__(self) -> None:
        self.garbage = 0
        self._buffer = b""

    def feed(self, data: bytes) -> list[str]:
        """The messages that ``data`` completes, each as its words joined by single spaces, without the brackets."""
        pieces = (self._buffer + data).split(b">")
        self._buffer = pieces.pop()
        messages = []
        for piece in pieces:
            before, opened, words = piece.rpartition(b"<")
            if before.strip() or not opened:
                self.garbage += 1
            if opened:
                messages.append(" ".join(words.decode("ascii", "replace").split()))
        if len(self._buffer) > MESSAGE_LIMIT:
            self._buffer = b""
            self.garbage += 1
        return messages


def format_send(frame: Frame) -> bytes:
    """The client's request to send a data frame."""
    data = "".join(f" {byte:x}" for byte in frame.data)
    return f"< send {_identifier(frame)} {len(frame.data)}{data} >".encode()


def parse_send(words: list[str]) -> Frame:
    """The frame of a request ``send ID LENGTH BYTE ...``, ``words`` being what follows ``send``.

    Eight hex digits make an extended identifier, as in the daemon. SavvyCAN adds bit 31 and lets identifiers and
    bytes be sign-extended: such digits are cut off. A length without bytes is how python-can's client writes a remote
    frame. Raises ``ValueError`` with the mistake in words.
    """
    if len(words) < _SEND_FIELDS - 1:
        raise ValueError("send needs an identifier and a length")
    frame = _frame_of(words[0], b"")
    if not re.fullmatch(r"[0-8]", words[1]):
        raise ValueError(f"length {words[1][:20]!r} is not 0 to 8")
    length, data = int(words[1]), bytes(_byte(word) for word in words[2:])
    if not data and length:
        return frame._replace(is_remote=True, remote_dlc=length)
    if len(data) != length:
        raise ValueError(f"length {length} but {len(data)} bytes")
    return frame._replace(data=data)


def format_frame(frame: Frame, stamp_us: int) -> bytes:
    """The server's report of a data frame at ``stamp_us`` microseconds since the epoch.

    An empty frame keeps both blanks: python-can's client fails on one. An error frame is reported by its class only.
    """
    stamp = f"{stamp_us // 1_000_000}.{stamp_us % 1_000_000:06d}"
    if frame.is_error:
        return f"< error {frame.arbitration_id:03X} {stamp} >".encode()
    return f"< frame {_identifier(frame)} {stamp} {frame.data.hex().upper()} >".encode()


def parse_frame(words: list[str]) -> Frame:
    """The frame of a report ``frame ID TIME DATA``, ``words`` being what follows ``frame``. Raises ``ValueError``."""
    if not _FRAME_FIELDS - 1 <= len(words) <= _FRAME_FIELDS or not re.fullmatch(r"\d+\.\d+", words[1]):
        raise ValueError("frame needs an identifier, a time and data")
    data = bytes.fromhex(words[2]) if len(words) == _FRAME_FIELDS else b""
    if len(data) > CAN_MAX_DLC:
        raise ValueError(f"{len(data)} data bytes")
    return _frame_of(words[0], data)


def _identifier(frame: Frame) -> str:
    return f"{frame.arbitration_id:08X}" if frame.is_extended else f"{frame.arbitration_id:03X}"


def _frame_of(digits: str, data: bytes) -> Frame:
    if not re.fullmatch(r"[0-9A-Fa-f]{1,16}", digits):
        raise ValueError(f"identifier {digits[:20]!r} is not hexadecimal")
    value = int(digits, 16) & 0xFFFF_FFFF
    if value & _FLAGS_OTHER:
        raise ValueError(f"identifier {digits} is above 1FFFFFFF")
    extended = bool(value & _FLAG_EXTENDED) or len(digits) == 8 or value > CAN_SFF_MASK
    return Frame(value & CAN_EFF_MASK, data, extended)


def _byte(digits: str) -> int:
    """One data byte; ``ffffffc3``, as SavvyCAN writes C3, too."""
    if not re.fullmatch(r"[0-9A-Fa-f]{1,2}|[Ff]{6,14}[89A-Fa-f][0-9A-Fa-f]", digits):
        raise ValueError(f"byte {digits[:20]!r} is not 0 to ff")
    return int(digits, 16) & 0xFF
