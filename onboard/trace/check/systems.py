"""Which rules judge the logs of which system, and what its machines say beyond the messages of all."""

from onboard.core.messages import Message
from onboard.core.site import Site
from onboard.kinds.terminal.messages import MESSAGES as TERMINAL_MESSAGES
from onboard.trace.check.checks import RULES, Checks
from onboard.trace.check.rule import Rule
from onboard.trace.check.terminal import TERMINAL_RULES
from onboard.wire.codec import codecs

#: By ``Site.system``; every other system's logs are judged as a car park's.
SYSTEMS: dict[str, tuple[tuple[type[Rule], ...], tuple[type[Message], ...]]] = {
    "terminal": (TERMINAL_RULES, TERMINAL_MESSAGES),
}


def rules_of(site: Site | None) -> tuple[type[Rule], ...]:
    """The rules of a site's own system; without a site those of a car park."""
    known = SYSTEMS.get(site.system) if site is not None else None
    return RULES if known is None else known[0]


def checks_for(site: Site | None, *, disturbed: bool = False) -> Checks:
    """The checks of a site's own system, with its contracts."""
    known = SYSTEMS.get(site.system) if site is not None else None
    if site is None or known is None:
        return Checks(site, disturbed=disturbed)
    both = codecs(site.system, known[1])
    return Checks(site, disturbed=disturbed, fleet=both.fleet, device=both.device, rules=known[0])
