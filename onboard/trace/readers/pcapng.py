"""CAN frames of pcapng files (IETF draft-ietf-opsawg-pcapng), link type 227 LINKTYPE_CAN_SOCKETCAN.

An interface's name is the channel. Sections of either byte order, any resolution of time, several sections.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Literal

from onboard.core.frame import CAN_EFF_MASK, CAN_MAX_DLC, CAN_SFF_MASK
from onboard.trace.raw import CANFD_FDF, CANFD_MAX_LEN, EFF_FLAG, ERR_FLAG, RTR_FLAG, RawFrame
from onboard.trace.readers.faults import LogFault, LogFaults

#: A section header block, the first of every file; the same in both byte orders.
MAGIC = b"\x0a\x0d\x0d\x0a"
LINKTYPE_SOCKETCAN = 227
BLOCK_SECTION, BLOCK_INTERFACE, BLOCK_PACKET = 0x0A0D_0D0A, 1, 6
BYTE_ORDER_MAGIC = 0x1A2B_3C4D
OPTION_END, OPTION_NAME, OPTION_RESOLUTION, OPTION_OFFSET, OPTION_FLAGS = 0, 2, 9, 14, 2
#: Two lowest bits of a packet's flags: which way it went.
INBOUND, OUTBOUND = 1, 2
#: A block longer than this is taken for damage, bytes: a CAN frame's takes some hundred.
_LONGEST_BLOCK = 1 << 24
_HEAD = 8
_MILLION = 1_000_000
_DECIMAL_US = 6


@dataclass
class _Interface:
    name: str
    link_type: int
    #: Ticks a second, and seconds to add.
    ticks: int = _MILLION
    offset_s: int = 0


@dataclass
class _Section:
    order: Literal["little", "big"] = "little"
    interfaces: list[_Interface] = field(default_factory=list)

    def number(self, data: bytes) -> int:
        return int.from_bytes(data, self.order)

    def options(self, data: bytes) -> dict[int, bytes]:
        found: dict[int, bytes] = {}
        at = 0
        while at + 4 <= len(data):
            code, size = self.number(data[at : at + 2]), self.number(data[at + 2 : at + 4])
            if code == OPTION_END:
                break
            found.setdefault(code, data[at + 4 : at + 4 + size])
            at += 4 + -(-size // 4) * 4
        return found


def read_pcapng(read: Callable[[int], bytes], faults: LogFaults) -> Iterator[tuple[int, RawFrame]]:
    """Frames with the numbers of their blocks. Damage ends the reading, counted as CUT: nothing says where to go on."""
    section = _Section()
    number = 0
    while head := read(_HEAD):
        number += 1
        if head[:4] == MAGIC and len(head) == _HEAD:
            order = read(4)
            section = _Section("little" if int.from_bytes(order, "little") == BYTE_ORDER_MAGIC else "big")
            head += order
        size = section.number(head[4:8])
        rest = size - len(head)
        body = read(rest) if 0 <= rest <= _LONGEST_BLOCK else b""
        if rest < 4 or len(body) < rest:
            faults.add(LogFault.CUT, number)
            return
        kind, body = section.number(head[:4]), body[:-4]
        if kind == BLOCK_INTERFACE:
            section.interfaces.append(_interface(section, body))
        elif kind == BLOCK_PACKET:
            found = _packet(section, body)
            if isinstance(found, LogFault):
                faults.add(found, number)
            else:
                yield number, found


def _interface(section: _Section, body: bytes) -> _Interface:
    options = section.options(body[8:])
    name = options.get(OPTION_NAME, b"").rstrip(b"\0").decode("utf-8", "replace").replace(" ", "_")
    found = _Interface(name or f"can{len(section.interfaces)}", section.number(body[:2]))
    resolution = options.get(OPTION_RESOLUTION, bytes([_DECIMAL_US]))[:1] or bytes([_DECIMAL_US])
    exponent = resolution[0] & 0x7F
    found.ticks = 1 << exponent if resolution[0] & 0x80 else 10**exponent
    found.offset_s = section.number(options.get(OPTION_OFFSET, b""))
    return found


def _packet(section: _Section, body: bytes) -> RawFrame | LogFault:
    interface_id, high, low, captured = (section.number(body[at : at + 4]) for at in (0, 4, 8, 12))
    if interface_id >= len(section.interfaces) or len(body) < 20 + captured:
        return LogFault.NOT_A_LINE
    interface = section.interfaces[interface_id]
    packet = body[20 : 20 + captured]
    if interface.link_type != LINKTYPE_SOCKETCAN or len(packet) < 8:
        return LogFault.NOT_A_LINE
    ticks = high << 32 | low
    time_us = interface.offset_s * _MILLION + ticks * _MILLION // interface.ticks
    flags = section.number(section.options(body[20 + -(-captured // 4) * 4 :]).get(OPTION_FLAGS, b"")) & 3
    sent = {INBOUND: False, OUTBOUND: True}.get(flags)
    return _frame(time_us, interface.name, packet, sent)


def _frame(time_us: int, channel: str, packet: bytes, sent: bool | None) -> RawFrame | LogFault:
    """The packet of a SocketCAN capture: identifier and flags big-endian, length, FD flags, two reserved, data."""
    word, size, fd = int.from_bytes(packet[:4], "big"), packet[4], packet[5]
    flexible = bool(fd & CANFD_FDF) or size > CAN_MAX_DLC
    if size > CANFD_MAX_LEN:
        return LogFault.DATA
    extended, is_error, remote = bool(word & EFF_FLAG), bool(word & ERR_FLAG), bool(word & RTR_FLAG)
    can_id = word & (CAN_EFF_MASK if extended or is_error else CAN_SFF_MASK)
    if remote and not is_error:
        return RawFrame(time_us, channel, can_id, b"", extended, True, False, min(size, CAN_MAX_DLC), None, sent)
    data = packet[8 : 8 + size]
    if len(data) < size:
        return LogFault.DATA
    flags = fd & 0x0F if flexible else None
    return RawFrame(time_us, channel, can_id, data, extended and not is_error, False, is_error, 0, flags, sent)
