"""Error frames in the words of can-utils (``snprintf_can_error_frame``), bits as in linux/can/error.h."""

from onboard.trace.raw import RawFrame

_LOST_ARBITRATION, _CONTROLLER, _PROTOCOL = 0x002, 0x004, 0x008
_CLASSES = (
    "tx-timeout",
    "lost-arbitration",
    "controller-problem",
    "protocol-violation",
    "transceiver-status",
    "no-acknowledgement-on-tx",
    "bus-off",
    "bus-error",
    "restarted-after-bus-off",
)
_CONTROLLER_PROBLEMS = (
    "rx-overflow",
    "tx-overflow",
    "rx-error-warning",
    "tx-error-warning",
    "rx-error-passive",
    "tx-error-passive",
    "back-to-error-active",
)
_VIOLATIONS = (
    "single-bit-error",
    "frame-format-error",
    "bit-stuffing-error",
    "tx-dominant-bit-error",
    "tx-recessive-bit-error",
    "bus-overload",
    "active-error",
    "error-on-tx",
)
#: Where in the frame: ``CAN_ERR_PROT_LOC_*``, the codes of the SJA1000's error code capture.
_PLACES = {
    0x02: "id.28-to-id.21",
    0x03: "start-of-frame",
    0x04: "bit-srtr",
    0x05: "bit-ide",
    0x06: "id.20-to-id.18",
    0x07: "id.17-to-id.13",
    0x08: "crc-sequence",
    0x09: "reserved-bit-0",
    0x0A: "data-field",
    0x0B: "data-length-code",
    0x0C: "bit-rtr",
    0x0D: "reserved-bit-1",
    0x0E: "id.4-to-id.0",
    0x0F: "id.12-to-id.5",
    0x11: "active-error-flag",
    0x12: "intermission",
    0x13: "tolerate-dominant-bits",
    0x16: "passive-error-flag",
    0x17: "error-delimiter",
    0x18: "crc-delimiter",
    0x19: "acknowledge-slot",
    0x1A: "end-of-frame",
    0x1B: "acknowledge-delimiter",
    0x1C: "overload-flag",
}
_LAST_PLACE = 0x1C


def describe(frame: RawFrame) -> str:
    """What an error frame says, such as ``controller-problem{rx-error-warning}``; empty for a class that is none."""
    if frame.can_id > 1 << len(_CLASSES):
        return ""
    data = frame.data.ljust(8, b"\0")
    words = []
    for bit, name in enumerate(_CLASSES):
        if frame.can_id >> bit & 1:
            words.append(name + _detail(1 << bit, data))
    if data[6] or data[7]:
        words.append(f"error-counter-tx-rx{{{{{data[6]}}}{{{data[7]}}}}}")
    return ",".join(words)


def _detail(error_class: int, data: bytes) -> str:
    if error_class == _LOST_ARBITRATION:
        return f"{{at bit {data[0]}}}"
    if error_class == _CONTROLLER and data[1]:
        return f"{{{_names(_CONTROLLER_PROBLEMS, data[1])}}}"
    if error_class == _PROTOCOL:
        place = _PLACES.get(data[3], "unspecified") if 0 < data[3] <= _LAST_PLACE else ""
        return f"{{{{{_names(_VIOLATIONS, data[2])}}}{{{place}}}}}"
    return ""


def _names(table: tuple[str, ...], bits: int) -> str:
    return ",".join(name for bit, name in enumerate(table) if bits >> bit & 1)
