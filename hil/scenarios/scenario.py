"""A scenario as data: what happens, what it asks of the bench, and what of it may look like a fault."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from bus_sim.systems.registry import simulated_of
from hil.bench import Capability
from hil.stage import TestBench
from onboard.contract.codes import KindCode, Reason
from onboard.contract.constants import MOBILE_KINDS
from onboard.core.site import Machine, Site


@dataclass(frozen=True, slots=True)
class BenchScenario:
    """``play`` raises ``AssertionError`` where the device does something else than it should.

    ``needs``: capabilities of the bench. ``kinds``: kinds of machine that can do this; none for all. ``rivals``:
    machines of the device's own kind are run as well. ``drops``: reasons for which the device may drop input here.
    ``wire_errors``: error counters may rise. ``late``: frames may be lost or leave late. ``ends``: the device stops.
    """

    name: str
    play: Callable[[TestBench], Awaitable[None]]
    needs: frozenset[Capability]
    kinds: frozenset[KindCode] = frozenset()
    rivals: bool = False
    drops: frozenset[Reason] = frozenset()
    wire_errors: bool = False
    late: bool = False
    ends: bool = False

    def without(self, site: Site, machine: Machine) -> frozenset[str]:
        """Machines of the site that the simulated fleet does without: the device itself, and who could do its work."""
        can_work = (*MOBILE_KINDS, simulated_of(site).worker)
        alike = [one.name for one in site.machines.values() if one.kind is machine.kind and one.kind in can_work]
        return frozenset([machine.name] if self.rivals else [machine.name, *alike])

    @property
    def is_disturbed(self) -> bool:
        """Whether rules that need every frame are left out of the judgement."""
        return self.wire_errors or self.late or self.ends
