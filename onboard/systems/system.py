"""What a system says of itself to the machines that run it."""

from collections.abc import Mapping
from dataclasses import dataclass

from onboard.contract.codes import KindCode
from onboard.core.behaviour import BehaviourFactory
from onboard.core.journal_records import RecordTypes


@dataclass(frozen=True, slots=True)
class System:
    """One kind of site: ``name`` as site files say it, and what drives each kind of machine there.

    ``records`` are what its machines write into their journals beside the core's own; a type that is not there is kept
    for good.
    """

    name: str
    factories: Mapping[KindCode, BehaviourFactory]
    records: RecordTypes = ()
