"""Which rules judge which system's logs: the one place to add a system's own."""

from onboard.core.site import Site
from onboard.trace.check import cell, turning
from onboard.trace.check.calls import BidsGoDown, BidsInTime, CallsClosed
from onboard.trace.check.checks import RULES
from onboard.trace.check.rights import OneHolder
from onboard.trace.check.rule import Rule

#: What every system keeps to, whatever its machines do.
COMMON: tuple[type[Rule], ...] = (OneHolder, CallsClosed, BidsInTime, BidsGoDown)

#: By ``Site.system``; a system that is not here is judged by what is common to all.
SYSTEM_RULES: dict[str, tuple[type[Rule], ...]] = {
    "car-park": RULES,
    "cell": cell.RULES,
    "turning": turning.RULES,
}


def rules_for(site: Site | None) -> tuple[type[Rule], ...]:
    """The rules for a site's logs; without a site those of a car park, which leave out what needs one."""
    return RULES if site is None else SYSTEM_RULES.get(site.system, COMMON)
