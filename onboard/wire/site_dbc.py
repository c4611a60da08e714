"""The DBC of one site: one message for each machine (``MR1_Bid``), so that stock tools decode without an id mask.

Masked decoding makes cantools' monitor and plot merge all machines into one line; a full identifier for each sender
does not. Text is templated, as cantools' own writer reorders signals and drops attributes.
"""

from collections.abc import Iterable, Iterator

from onboard.contract.codes import KindCode
from onboard.contract.constants import MAX_NODE_ID
from onboard.core.site import Machine, Site
from onboard.wire.dbc_file import MessageLayout, SignalLayout, device_layouts, fleet_layouts, system_layouts
from onboard.wire.speakers import GATEWAY, is_in

#: Device messages by the roles of both ends: a robot's controller sends nothing to doors.
_ENDS: dict[KindCode, frozenset[str]] = {
    KindCode.ROBOT: frozenset({"Controller", "Drive", "Shuttle", "Battery"}),
    KindCode.LIFT: frozenset({"Controller", "Drive", "Platform"}),
    KindCode.COMPARTMENT: frozenset({"Controller", "Doors", "Desk", "Bay"}),
}
#: Node-IDs kept for gateways; a site file does not name them.
_GATEWAY_IDS = range(MAX_NODE_ID + 1, 256)
_EXTENDED = 1 << 31
#: What a DBC writes for nobody.
_NO_NODE = "Vector__XXX"


def _sent_by(system: str, machine: Machine, machines: Iterable[Machine]) -> Iterator[tuple[MessageLayout, str]]:
    """What a machine, or its devices, say, and the names of those who listen."""
    for layout in fleet_layouts(system):
        if is_in(machine.kind, layout.senders):
            others = [one.name for one in machines if one != machine and is_in(one.kind, layout.receivers)]
            yield layout, ",".join(others) or _NO_NODE
    if machine.kind not in _ENDS:
        # A system's own contract does not say which of its kinds has which devices.
        yield from ((layout, machine.name) for layout in system_layouts(system)[1])
        return
    for layout in device_layouts(system):
        if set(layout.senders) | set(layout.receivers) <= _ENDS[machine.kind]:
            yield layout, machine.name


def _gateways(taken: Iterable[str]) -> dict[int, str]:
    """A name for each gateway, such as ``Gateway251``; other than any machine's."""
    names = set(taken)
    named = {}
    for node_id in _GATEWAY_IDS:
        name = f"{GATEWAY}{node_id}"
        while name in names:
            name = f"x{name}"
        named[node_id] = name
    return named


def _sent_by_gateway(system: str, machines: Iterable[Machine]) -> Iterator[tuple[MessageLayout, str]]:
    """What a gateway says, an operator's orders foremost, and the names of the machines that listen."""
    for layout in fleet_layouts(system):
        if GATEWAY in layout.senders:
            hearing = [one.name for one in machines if is_in(one.kind, layout.receivers)]
            yield layout, ",".join(hearing) or _NO_NODE


def _signal(signal: SignalLayout, receivers: str) -> str:
    sign = "-" if signal.signed else "+"
    return (
        f" SG_ {signal.name} : {signal.shift}|{signal.bits}@1{sign} ({signal.scale},{signal.offset}) "
        f'[{signal.minimum}|{signal.maximum}] "{signal.unit}" {receivers}'
    )


def site_dbc(site: Site) -> str:
    """DBC text with every message of every machine of a site, full identifiers, comments and value tables kept.

    The gateways that a site may have (nodes 251 to 255) are in it too, so that an operator's orders decode.
    """
    machines = list(site.machines.values())
    gateways = _gateways(machine.name for machine in machines)
    names = [machine.name for machine in machines] + list(gateways.values())
    senders = [(one.node_id, one.name, list(_sent_by(site.system, one, machines))) for one in machines]
    senders += [(node_id, name, list(_sent_by_gateway(site.system, machines))) for node_id, name in gateways.items()]
    lines = ['VERSION ""', "", "NS_ :", "\tCM_", "\tBA_DEF_", "\tBA_", "\tVAL_", "\tBA_DEF_DEF_", "", "BS_:", ""]
    lines += ["BU_: " + " ".join(names), ""]
    comments = [f'CM_ "Site {site.name}, digest {site.digest}: one message for each machine. Generated; do not edit.";']
    attributes: list[str] = []
    values: list[str] = []
    for node_id, name, sent in senders:
        for layout, receivers in sent:
            number = _EXTENDED | layout.frame_id | node_id
            lines.append(f"BO_ {number} {name}_{layout.name}: {layout.length} {name}")
            lines += [_signal(signal, receivers) for signal in layout.signals] + [""]
            comments.append(f'CM_ BO_ {number} "{layout.comment}";')
            comments += [f'CM_ SG_ {number} {signal.name} "{signal.comment}";' for signal in layout.signals]
            if layout.cycle_ms:
                attributes.append(f'BA_ "GenMsgCycleTime" BO_ {number} {layout.cycle_ms};')
            for signal in layout.signals:
                if signal.choices:
                    table = " ".join(f'{value} "{word}"' for value, word in reversed(signal.choices))
                    values.append(f"VAL_ {number} {signal.name} {table} ;")
    definitions = ['BA_DEF_ BO_  "GenMsgCycleTime" INT 0 60000;', 'BA_DEF_DEF_  "GenMsgCycleTime" 0;']
    return "\n".join([*lines, *comments, "", *definitions, *attributes, "", *values]) + "\n"
