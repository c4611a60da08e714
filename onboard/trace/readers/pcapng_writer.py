"""Writes pcapng with one named interface for each bus, link type LINKTYPE_CAN_SOCKETCAN, as Wireshark reads it."""

from typing import BinaryIO

from onboard.trace.raw import CANFD_FDF, RawFrame
from onboard.trace.readers.pcapng import (
    BLOCK_INTERFACE,
    BLOCK_PACKET,
    BLOCK_SECTION,
    BYTE_ORDER_MAGIC,
    INBOUND,
    LINKTYPE_SOCKETCAN,
    OPTION_END,
    OPTION_FLAGS,
    OPTION_NAME,
    OUTBOUND,
)

#: Length of a section that is not known when its header is written.
_UNKNOWN_LENGTH = (1 << 64) - 1
_VERSION_MAJOR = 1


class PcapngWriter:
    """Feed frames in the order of the log; times in microseconds, the format's default. The caller owns the file."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._interfaces: dict[str, int] = {}
        body = _u32(BYTE_ORDER_MAGIC) + _u16(_VERSION_MAJOR) + _u16(0) + _UNKNOWN_LENGTH.to_bytes(8, "little")
        self._block(BLOCK_SECTION, body)

    def write(self, frame: RawFrame) -> None:
        """Add a frame; its channel's interface is described before its first frame."""
        interface = self._interfaces.get(frame.channel)
        if interface is None:
            interface = self._interfaces[frame.channel] = len(self._interfaces)
            name = _option(OPTION_NAME, frame.channel.encode())
            self._block(BLOCK_INTERFACE, _u16(LINKTYPE_SOCKETCAN) + _u16(0) + _u32(0) + name + _option(OPTION_END, b""))
        packet = _packet(frame)
        body = _u32(interface) + _u32(frame.time_us >> 32) + _u32(frame.time_us & 0xFFFF_FFFF)
        body += _u32(len(packet)) * 2 + _padded(packet)
        if frame.sent is not None:
            body += _option(OPTION_FLAGS, _u32(OUTBOUND if frame.sent else INBOUND)) + _option(OPTION_END, b"")
        self._block(BLOCK_PACKET, body)

    def _block(self, kind: int, body: bytes) -> None:
        size = _u32(len(body) + 12)
        self._file.write(_u32(kind) + size + body + size)


def _packet(frame: RawFrame) -> bytes:
    """As in a SocketCAN capture: identifier and flags big-endian, length, FD flags, two reserved bytes, data."""
    fd_flags = 0 if frame.fd_flags is None else frame.fd_flags | CANFD_FDF
    return frame.socketcan_id.to_bytes(4, "big") + bytes([frame.length, fd_flags, 0, 0]) + frame.data


def _option(code: int, value: bytes) -> bytes:
    return _u16(code) + _u16(len(value)) + _padded(value)


def _padded(data: bytes) -> bytes:
    return data + bytes(-len(data) % 4)


def _u16(value: int) -> bytes:
    return value.to_bytes(2, "little")


def _u32(value: int) -> bytes:
    return value.to_bytes(4, "little")
