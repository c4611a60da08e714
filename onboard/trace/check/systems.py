"""Which rules judge the logs of which system, and what its machines say beyond the messages of all."""

from onboard.core.messages import Message
from onboard.core.site import Site
from onboard.kinds.terminal.messages import MESSAGES as TERMINAL_MESSAGES
from onboard.trace.check.checks import RULES, Checks
from onboard.trace.check.rule import Rule
from onboard.trace.check.terminal import TERMINAL_RULES
from onboard.wire.codec import Codec, codecs

#: By ``Site.system``; every other system's logs are judged as a car park's.
SYSTEMS: dict[str, tuple[tuple[type[Rule], ...], tuple[type[Message], ...]]] = {
    "terminal": (TERMINAL_RULES, TERMINAL_MESSAGES),
}


def checks_for(site: Site | None, *, disturbed: bool = False, fleet: Codec | None = None) -> Checks:
    """The checks of a site's own system; ``fleet`` replaces the built-in contract of the fleet bus."""
    known = SYSTEMS.get(site.system) if site is not None else None
    if site is None or known is None:
        return Checks(site, disturbed=disturbed, fleet=fleet, rules=RULES)
    rules, messages = known
    both = codecs(site.system, messages)
    return Checks(site, disturbed=disturbed, fleet=fleet or both.fleet, device=both.device, rules=rules)
