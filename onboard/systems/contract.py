"""The contract of a site's two buses: the messages of all, and what its system adds to them."""

from onboard.core.site import Site
from onboard.systems.registry import part
from onboard.wire.codec import Codecs, codecs


def codecs_for(site: Site | None) -> Codecs:
    """Both codecs of a site; without one those of what every system says. No machine of the system is loaded."""
    module = part(site.system, "frames") if site is not None else None
    return codecs(module.FRAMES if module is not None else ())
