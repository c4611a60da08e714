"""A Wireshark dissector in Lua, generated from the DBC: every signal is a field, such as ``onboard.bid.cost``.

A heuristic dissector of the protocol ``can`` (Wireshark User's Guide, appendix Lua): 29-bit frames whose identifier is
of the contract, whatever the node-ID in its lowest byte; all others are left to Wireshark.
"""

from collections.abc import Iterable, Iterator

from onboard.core.site import Site
from onboard.wire.dbc_file import MessageLayout, SignalLayout, device_layouts, fleet_layouts

_HEAD = """\
-- Fleet and device messages of the Mechatronics Interaction Protocol. Generated from the DBC; do not edit.
-- Use: copy into Wireshark's plug-in folder (Help, About, Folders), or  tshark -X lua_script:onboard.lua -r run.pcapng
local fleet = Proto("onboard", "Mechatronics Interaction Protocol")
local can_id, extended = Field.new("can.id"), Field.new("can.flags.xtd")
local fields, messages = {}, {}
"""
_TAIL = """\
fleet.fields = fields

local function value_of(word, signal)
    local raw = word:rshift(signal.shift):band(signal.mask)
    if signal.wide then
        return raw
    end
    local number = raw:tonumber()
    if signal.sign and number >= signal.sign then
        number = number - 2 * signal.sign
    end
    return number * signal.scale + signal.offset
end

local function dissect(buffer, packet, tree)
    local id, is_extended = can_id(), extended()
    if id == nil or is_extended == nil or not is_extended.value then
        return false
    end
    local sender = id.value % 256
    local message = messages[id.value - sender]
    if message == nil or sender == 0 or buffer:len() < message.length then
        return false
    end
    local padded = ByteArray.new()
    padded:append(buffer:range(0, message.length):bytes())
    padded:set_size(8)
    local word = padded:tvb("word"):range(0, 8):le_uint64()
    local name = senders[sender] or ("node " .. sender)
    packet.cols.protocol = "MIP"
    packet.cols.info = name .. " " .. message.name
    local branch = tree:add(fleet, buffer:range(0, message.length), "MIP " .. message.name .. " of " .. name)
    branch:add(fields.message, message.name):set_generated()
    branch:add(fields.sender, sender):set_generated()
    branch:add(fields.sender_name, name):set_generated()
    for _, signal in ipairs(message.signals) do
        branch:add(signal.field, buffer:range(signal.first, signal.count), value_of(word, signal))
    end
    return true
end

fleet:register_heuristic("can", dissect)
"""
#: A signal wider than this is a 64-bit field: Lua's numbers in Wireshark hold 32 bits and a sign safely.
_WIDE_BITS = 32


def dissector(site: Site | None = None, system: str = "") -> str:
    """The Lua text for the contract of ``system``; with a site the senders have their names."""
    names = {machine.node_id: machine.name for machine in site.machines.values()} if site is not None else {}
    lines = [
        _HEAD + _table("local senders", names),
        'fields.message = ProtoField.string("onboard.message", "message")',
        'fields.sender = ProtoField.uint8("onboard.sender", "sender", base.DEC)',
        'fields.sender_name = ProtoField.string("onboard.sender.name", "sender\'s name")',
    ]
    # The system's own messages come with both buses; one is enough.
    layouts = {one.frame_id: one for one in (*fleet_layouts(system), *device_layouts(system))}
    for layout in layouts.values():
        lines += _message(layout)
    return "\n".join([*lines, "", _TAIL])


def _message(layout: MessageLayout) -> Iterator[str]:
    yield ""
    yield f"messages[{layout.frame_id}] = {{name = {_text(layout.name)}, length = {layout.length}, signals = {{}}}}"
    for signal in layout.signals:
        yield f"fields[#fields + 1] = {_field(layout, signal)}"
        first, last = signal.shift // 8, (signal.shift + signal.bits - 1) // 8
        mask = f'UInt64.fromhex("{(1 << signal.bits) - 1:x}")'
        sign = f"sign = {1 << signal.bits - 1}, " if signal.signed else ""
        wide = "wide = true, " if signal.bits > _WIDE_BITS else ""
        yield (
            f"table.insert(messages[{layout.frame_id}].signals, {{field = fields[#fields], shift = {signal.shift}, "
            f"mask = {mask}, {sign}{wide}scale = {signal.scale}, offset = {signal.offset}, "
            f"first = {first}, count = {last - first + 1}}})"
        )


def _field(layout: MessageLayout, signal: SignalLayout) -> str:
    kind = "uint64" if signal.bits > _WIDE_BITS else "int32" if signal.signed or signal.offset < 0 else "uint32"
    label = f"{signal.name} [{signal.unit}]" if signal.unit else signal.name
    choices = _pairs(signal.choices) if signal.choices else "nil"
    abbreviation = f"onboard.{layout.name.lower()}.{signal.name.lower()}"
    return (
        f"ProtoField.{kind}({_text(abbreviation)}, {_text(label)}, base.DEC, {choices}, nil, {_text(signal.comment)})"
    )


def _table(name: str, values: dict[int, str]) -> str:
    return f"{name} = {_pairs(sorted(values.items()))}"


def _pairs(values: Iterable[tuple[int, str]]) -> str:
    return "{" + ", ".join(f"[{number}] = {_text(name)}" for number, name in values) + "}"


def _text(value: str) -> str:
    """A Lua string; the DBC's texts are plain."""
    escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ")
    return f'"{escaped}"'
