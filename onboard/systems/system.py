"""What a system says of itself to the machines that run it."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from onboard.core.behaviour import BehaviourFactory
from onboard.core.codes import KindCode
from onboard.core.messages import Message
from onboard.work.compaction import Rules


@dataclass(frozen=True, slots=True)
class System:
    """One kind of site: ``name`` as site files say it, and what drives each kind of machine there.

    ``messages`` are the classes of what the system's own DBC file adds to the contracts of all. ``records`` say what of
    its journal outlives compaction, beside the core's own; a record that is not named is kept for good.
    """

    name: str
    factories: Mapping[KindCode, BehaviourFactory]
    messages: tuple[type[Message], ...] = ()
    records: Rules = field(default_factory=dict)
