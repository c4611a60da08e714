"""What a person names on the command line, by the site file: machines, segments, nodes, reasons."""

import re

from onboard.config.problems import nearest
from onboard.contract.codes import Reason
from onboard.contract.constants import MAX_NODE_ID, MOBILE_KINDS, NOBODY
from onboard.core.site import Machine, Segment, Site
from onboard.ways.site import TrackKind, way_site

#: Node-IDs under which a person's tool may speak (dbc/fleet.dbc: kept for gateways and tools).
FIRST_TOOL, LAST_TOOL = MAX_NODE_ID + 1, 255


class OperateError(Exception):
    """A mistake of the person; ``str`` is one line that names the value and the remedy."""


def machine_of(site: Site, name: str) -> Machine:
    """The machine of this name. Raises ``OperateError``."""
    try:
        return site.machine(name)
    except KeyError:
        known = [machine.name for machine in site.machines.values()]
        raise OperateError(f"{name}: no machine of site {site.name}; {nearest(name, known)}") from None


def movable_of(site: Site, name: str) -> Machine:
    """A machine that a person can hold: one that moves about (row M38). Raises ``OperateError``."""
    machine = machine_of(site, name)
    if site.no_hold:
        raise OperateError(f"{name}: cannot be held: {site.no_hold}; use stop")
    if machine.kind not in MOBILE_KINDS:
        remedy = "block, or stop" if way_site(site).tracks else "stop"
        raise OperateError(f"{name}: a {machine.kind.name.lower()} does not move about; use {remedy}")
    return machine


def segment_of(site: Site, text: str) -> Segment:
    """A segment of an alley or a spur, written ``p(1,3)``. Raises ``OperateError``."""
    if not way_site(site).tracks:
        raise OperateError(f"{text}: a {site.called} has no segments that can be blocked")
    match = re.fullmatch(r"p\((\d{1,3}),(\d{1,3})\)", text.replace(" ", ""))
    segment = Segment(int(match[1]), int(match[2])) if match is not None else None
    track = way_site(site).tracks.get(segment.track) if segment is not None else None
    if segment is None or track is None or track.kind is TrackKind.LIFT or not 1 <= segment.index <= track.length:
        numbers = [str(one) for one, track in way_site(site).tracks.items() if track.kind is not TrackKind.LIFT]
        raise OperateError(
            f"{text}: no segment of site {site.name}; write p(TRACK,INDEX), tracks are {', '.join(numbers)}"
        )
    return segment


def slot_of(site: Site, text: str) -> Segment:
    """A slot in which a body can be: a segment, or a lift's platform by the lift's name. Raises ``OperateError``."""
    lifts = {machine.name: machine for machine in site.machines.values() if machine.home.track in way_site(site).lifts}
    if text not in lifts:
        return segment_of(site, text)
    return way_site(site).beyond(way_site(site).tracks[lifts[text].home.track].joins[0])


def node_of(site: Site, text: str) -> int:
    """A node by its machine's name or by its number, 1 to 255. Raises ``OperateError``."""
    if text.isdecimal() and len(text) <= len(str(LAST_TOOL)) and NOBODY < int(text) <= LAST_TOOL:
        return int(text)
    try:
        return machine_of(site, text).node_id
    except OperateError as error:
        raise OperateError(f"{error}, or a node-ID from 1 to {LAST_TOOL}") from None


def tool_of(node: int) -> int:
    """A node-ID for this tool. Raises ``OperateError``."""
    if not FIRST_TOOL <= node <= LAST_TOOL:
        raise OperateError(f"--node {node}: no node-ID of a tool; from {FIRST_TOOL} to {LAST_TOOL}")
    return node


def reason_of(text: str) -> Reason:
    """A reason by its name in the DBC, in any case. Raises ``OperateError``."""
    known = {one.name.lower(): one for one in Reason if one is not Reason.NONE}
    found = known.get(text.lower().replace("-", "_").replace(" ", "_"))
    if found is None:
        raise OperateError(f"--reason {text}: not known; {nearest(text, list(known))}")
    return found
