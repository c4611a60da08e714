"""A Wireshark dissector in Lua, generated from the DBC: every signal is a field, such as ``onboard.bid.cost``.

A heuristic dissector of the protocol ``can`` (Wireshark User's Guide, appendix Lua): 29-bit frames whose identifier is
of the contract, whatever the node-ID in its lowest byte; all others are left to Wireshark.
"""

from collections.abc import Iterable, Iterator

from onboard.contract.seal import SealAnswer, SealChallenge, SealTo
from onboard.core.site import Site
from onboard.seal.heard import MOST_WAITING, WAITS_US
from onboard.wire.dbc_file import MessageLayout, SignalLayout, device_layouts, fleet_layouts

_HEAD = """\
-- Fleet and device messages of the Mechatronics Interaction Protocol. Generated from the DBC; do not edit.
-- Use: copy into Wireshark's plug-in folder (Help, About, Folders), or  tshark -X lua_script:onboard.lua -r run.pcapng
-- Whether a frame is sealed stands behind it, so it takes two passes:  tshark -2 -R onboard -X lua_script:...
local fleet = Proto("onboard", "Mechatronics Interaction Protocol")
local can_id, extended = Field.new("can.id"), Field.new("can.flags.xtd")
local fields, messages = {}, {}
-- Of each sender the frames that wait for a seal; of each frame the number of its seal, of each seal its frames.
local waiting, noted, sealed_by, seal_of = {}, {}, {}, {}
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

-- A Seal stands behind the frames of its sender; that of a sign of life right behind it. Whether it was noted before.
local function note_seal(packet, sender, name)
    if noted[packet.number] then
        return true
    end
    noted[packet.number] = true
    local list, now = waiting[sender] or {}, tonumber(packet.abs_ts)
    if name == "Seal" then
        seal_of[packet.number] = {}
        for _, frame in ipairs(list) do
            if now - frame.time < WAITS_S then
                sealed_by[frame.number] = packet.number
                table.insert(seal_of[packet.number], frame.number)
            end
        end
        list = {}
    else
        if list[1] and list[1].is_beat then
            list = {}
        end
        table.insert(list, {number = packet.number, time = now, is_beat = name == "Heartbeat"})
        if #list > MOST_WAITING then
            table.remove(list, 1)
        end
    end
    waiting[sender] = list
    return false
end

local function add_seal(branch, packet, sender, name)
    -- Whether a frame is sealed is known only behind it: not in a first pass.
    local is_known = note_seal(packet, sender, name)
    for _, number in ipairs(seal_of[packet.number] or {}) do
        branch:add(fields.seal_of, number):set_generated()
    end
    if name == "Seal" or not is_known then
        return
    end
    local seal = sealed_by[packet.number]
    branch:add(fields.sealed, seal ~= nil):set_generated()
    if seal then
        branch:add(fields.sealed_by, seal):set_generated()
    end
end

function fleet.init()
    waiting, noted, sealed_by, seal_of = {}, {}, {}, {}
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
    if on_fleet[message.name] and not in_pair[message.name] then
        add_seal(branch, packet, sender, message.name)
    end
    for _, signal in ipairs(message.signals) do
        branch:add(signal.field, buffer:range(signal.first, signal.count), value_of(word, signal))
    end
    return true
end

fleet:register_heuristic("can", dissect)
-- Wireshark builds the trees of its first pass for whoever listens, and fields are read from trees.
Listener.new("frame", "onboard")
"""
#: A signal wider than this is a 64-bit field: Lua's numbers in Wireshark hold 32 bits and a sign safely.
_WIDE_BITS = 32
#: What two nodes prove to each other; nothing of it has a seal behind it that all can judge.
_IN_PAIR = tuple(one.__name__ for one in (SealTo, SealChallenge, SealAnswer))


def dissector(site: Site | None = None, system: str = "") -> str:
    """The Lua text for the contract of ``system``; with a site the senders have their names."""
    names = {machine.node_id: machine.name for machine in site.machines.values()} if site is not None else {}
    lines = [
        _HEAD + _table("local senders", names),
        'fields.message = ProtoField.string("onboard.message", "message")',
        'fields.sender = ProtoField.uint8("onboard.sender", "sender", base.DEC)',
        'fields.sender_name = ProtoField.string("onboard.sender.name", "sender\'s name")',
        'fields.sealed = ProtoField.bool("onboard.sealed", "sealed", base.NONE, {"yes, whatever it is worth", "no"})',
        'fields.seal_of = ProtoField.framenum("onboard.seal.of", "seals frame")',
        'fields.sealed_by = ProtoField.framenum("onboard.sealed.by", "by the seal in frame")',
        f"local WAITS_S, MOST_WAITING = {WAITS_US / 1e6}, {MOST_WAITING}",
        f"local in_pair = {{{', '.join(f'{one} = true' for one in _IN_PAIR)}}}",
        f"local on_fleet = {{{', '.join(f'{one.name} = true' for one in fleet_layouts(system))}}}",
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
