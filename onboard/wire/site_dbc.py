"""The DBC of one site: one message for each machine (``MR1_Bid``), so that stock tools decode without an id mask.

Masked decoding makes cantools' monitor and plot merge all machines into one line; a full identifier for each sender
does not. Text is templated, as cantools' own writer reorders signals and drops attributes.
"""

from collections.abc import Iterable, Iterator

from onboard.core.codes import KindCode
from onboard.core.site import Machine, Site
from onboard.wire.dbc_file import MessageLayout, SignalLayout, device_layouts, fleet_layouts

#: The node of the fleet contract that each kind of machine is.
_ROLES: dict[KindCode, str] = {
    KindCode.ROBOT: "Robot",
    KindCode.LIFT: "Lift",
    KindCode.COMPARTMENT: "Compartment",
}
#: Device messages by the roles of both ends: a robot's controller sends nothing to doors.
_ENDS: dict[KindCode, frozenset[str]] = {
    KindCode.ROBOT: frozenset({"Controller", "Drive", "Shuttle"}),
    KindCode.LIFT: frozenset({"Controller", "Drive", "Platform"}),
    KindCode.COMPARTMENT: frozenset({"Controller", "Doors", "Desk", "Bay"}),
}
_EXTENDED = 1 << 31
#: What a DBC writes for nobody.
_NO_NODE = "Vector__XXX"


def _sent_by(machine: Machine, machines: Iterable[Machine]) -> Iterator[tuple[MessageLayout, str]]:
    """What a machine, or its devices, say, and the names of those who listen."""
    for layout in fleet_layouts():
        if _ROLES[machine.kind] in layout.senders:
            others = [one.name for one in machines if one != machine and _ROLES[one.kind] in layout.receivers]
            yield layout, ",".join(others) or _NO_NODE
    for layout in device_layouts():
        if set(layout.senders) | set(layout.receivers) <= _ENDS[machine.kind]:
            yield layout, machine.name


def _signal(signal: SignalLayout, receivers: str) -> str:
    sign = "-" if signal.signed else "+"
    return (
        f" SG_ {signal.name} : {signal.shift}|{signal.bits}@1{sign} ({signal.scale},{signal.offset}) "
        f'[{signal.minimum}|{signal.maximum}] "{signal.unit}" {receivers}'
    )


def site_dbc(site: Site) -> str:
    """DBC text with every message of every machine of a site, full identifiers, comments and value tables kept."""
    machines = list(site.machines.values())
    names = [machine.name for machine in machines]
    lines = ['VERSION ""', "", "NS_ :", "\tCM_", "\tBA_DEF_", "\tBA_", "\tVAL_", "\tBA_DEF_DEF_", "", "BS_:", ""]
    lines += ["BU_: " + " ".join(names), ""]
    comments = [f'CM_ "Site {site.name}, digest {site.digest}: one message for each machine. Generated; do not edit.";']
    attributes: list[str] = []
    values: list[str] = []
    for machine in machines:
        for layout, receivers in _sent_by(machine, machines):
            number = _EXTENDED | layout.frame_id | machine.node_id
            lines.append(f"BO_ {number} {machine.name}_{layout.name}: {layout.length} {machine.name}")
            lines += [_signal(signal, receivers) for signal in layout.signals] + [""]
            comments.append(f'CM_ BO_ {number} "{layout.comment}";')
            comments += [f'CM_ SG_ {number} {signal.name} "{signal.comment}";' for signal in layout.signals]
            if layout.cycle_ms:
                attributes.append(f'BA_ "GenMsgCycleTime" BO_ {number} {layout.cycle_ms};')
            for signal in layout.signals:
                if signal.choices:
                    table = " ".join(f'{value} "{name}"' for value, name in reversed(signal.choices))
                    values.append(f"VAL_ {number} {signal.name} {table} ;")
    definitions = ['BA_DEF_ BO_  "GenMsgCycleTime" INT 0 60000;', 'BA_DEF_DEF_  "GenMsgCycleTime" 0;']
    return "\n".join([*lines, *comments, "", *definitions, *attributes, "", *values]) + "\n"
