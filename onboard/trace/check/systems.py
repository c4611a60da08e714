"""Which rules judge a site's logs: those of its system's folder, else what every system keeps to."""

from onboard.core.site import Site
from onboard.systems.registry import FIRST_SYSTEM, part
from onboard.trace.check.calls import BidsGoDown, BidsInTime, CallsClosed
from onboard.trace.check.rights import OneHolder
from onboard.trace.check.rule import Rule

#: What every system keeps to, whatever its machines do.
COMMON: tuple[type[Rule], ...] = (OneHolder, CallsClosed, BidsInTime, BidsGoDown)


def rules_for(site: Site | None) -> tuple[type[Rule], ...]:
    """The rules for a site's logs; without a site those of the first system, which leave out what needs one."""
    module = part(FIRST_SYSTEM if site is None else site.system, "checks")
    return COMMON if module is None else tuple(module.RULES)
