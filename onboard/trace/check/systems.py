"""Which rules judge which system's logs, and what its machines say beyond the messages of all: one place for both."""

from onboard.core.messages import Message
from onboard.core.site import Site
from onboard.systems.cell import checks as cell
from onboard.systems.cell.messages import MESSAGES as CELL_MESSAGES
from onboard.systems.graph import checks as graph
from onboard.systems.graph.messages import MESSAGES as GRAPH_MESSAGES
from onboard.systems.mapd import checks as mapd
from onboard.systems.mapd.messages import MESSAGES as MAPD_MESSAGES
from onboard.systems.terminal.checks import TERMINAL_RULES
from onboard.systems.terminal.messages import MESSAGES as TERMINAL_MESSAGES
from onboard.systems.turning import checks as turning
from onboard.systems.turning.messages import MESSAGES as TURNING_MESSAGES
from onboard.trace.check.calls import BidsGoDown, BidsInTime, CallsClosed
from onboard.trace.check.checks import RULES, Checks
from onboard.trace.check.rights import OneHolder
from onboard.trace.check.rule import Rule
from onboard.wire.codec import codecs

#: What every system keeps to, whatever its machines do.
COMMON: tuple[type[Rule], ...] = (OneHolder, CallsClosed, BidsInTime, BidsGoDown)

#: By ``Site.system``; a system that is not here is judged by what is common to all.
SYSTEM_RULES: dict[str, tuple[type[Rule], ...]] = {
    "car-park": RULES,
    "cell": cell.RULES,
    "graph": graph.RULES,
    "mapd": mapd.RULES,
    "terminal": TERMINAL_RULES,
    "turning": turning.RULES,
}
#: What the systems add to the contracts of all.
SYSTEM_MESSAGES: dict[str, tuple[type[Message], ...]] = {
    "cell": CELL_MESSAGES,
    "graph": GRAPH_MESSAGES,
    "mapd": MAPD_MESSAGES,
    "terminal": TERMINAL_MESSAGES,
    "turning": TURNING_MESSAGES,
}


def rules_for(site: Site | None) -> tuple[type[Rule], ...]:
    """The rules for a site's logs; without a site those of a car park, which leave out what needs one."""
    return RULES if site is None else SYSTEM_RULES.get(site.system, COMMON)


def checks_for(site: Site | None, *, disturbed: bool = False) -> Checks:
    """The checks of a site's own system, with its contracts."""
    if site is None:
        return Checks(site, disturbed=disturbed)
    both = codecs(site.system, SYSTEM_MESSAGES.get(site.system, ()))
    return Checks(site, disturbed=disturbed, fleet=both.fleet, device=both.device, rules=rules_for(site))
