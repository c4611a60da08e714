"""Who may say what on a fleet bus: the senders that the DBC names (``BO_TX_BU_``), as kinds of machine."""

from collections.abc import Iterable, Mapping

from onboard.contract.base import FrameCode
from onboard.contract.codes import KindCode, Reason
from onboard.contract.constants import MAX_NODE_ID, Speakers
from onboard.contract.messages import EmergencyStop, Message
from onboard.core.site import Machine

#: The node of the fleet contract that stands for people's tools and bridges to other buses.
GATEWAY = "Gateway"
#: The node of the fleet contract that each kind is.
_ROLES: dict[KindCode, str] = {
    KindCode.ROBOT: "Robot",
    KindCode.LIFT: "Lift",
    KindCode.COMPARTMENT: "Compartment",
    KindCode.OBSERVER: GATEWAY,
}
#: What machines of all other kinds are there; in the contract of their system they go by their kind's name.
_MACHINE = "Machine"


def is_in(kind: KindCode, nodes: Iterable[str]) -> bool:
    """Whether a kind of machine is among a contract's nodes."""
    roles = {_ROLES[kind]} if kind in _ROLES else {_MACHINE, kind.name.capitalize()}
    return not roles.isdisjoint(nodes)


def why_unheard(message: Message, machines: Mapping[int, Machine], speakers: Speakers) -> Reason:
    """Why no machine of a site listens to a message of its fleet bus: NOT_OF_SITE, NOT_OF_KIND; NONE where they do.

    For who watches a site: its machines have their own rule (holon/admission.py).
    """
    kinds = speakers.get(type(message))
    if kinds is None or isinstance(message, EmergencyStop):
        return Reason.NONE
    machine = machines.get(message.sender)
    if machine is None and message.sender <= MAX_NODE_ID:
        return Reason.NOT_OF_SITE
    kind = KindCode.OBSERVER if machine is None else machine.kind
    return Reason.NONE if kind in kinds else Reason.NOT_OF_KIND


def speakers_of(frames: Iterable[FrameCode]) -> Speakers:
    """By class of message the kinds that may say it."""
    return {
        one.says: frozenset(kind for kind in KindCode if kind is not KindCode.ANY and is_in(kind, one.senders))
        for one in frames
        if one.says is not None
    }
