"""What a system says of itself to the machines that run it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

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


@runtime_checkable
class WithSecrets(Protocol):
    """A factory whose machines know what nobody else of the site may: the same for all machines of the kind."""

    def with_secrets(self, secrets: tuple[bytes, ...]) -> BehaviourFactory:
        """The same for these secrets, 32 bytes each: the newest first, then those that still count for a while."""
