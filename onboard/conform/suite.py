"""All that is played before a node of a site: what every system has, then what its own adds."""

from onboard.conform import always
from onboard.conform.player import Scene, Watching
from onboard.conform.scenes import halting, hostile, joining
from onboard.core.site import Site
from onboard.systems.registry import part

#: What is judged all the time, of a node of any system.
WATCHERS: tuple[Watching, ...] = ((always.ALWAYS, always.watch),)


def scenes_of(site: Site) -> tuple[Scene, ...]:
    """The scenes in the order in which they are played."""
    own = part(site.system, "conform")
    scenes, last = ((), ()) if own is None else (own.SCENES, own.LAST)
    return (*joining.SCENES, *scenes, *hostile.SCENES, *halting.SCENES, *last)


def watchers_of(site: Site) -> tuple[Watching, ...]:
    """What is judged of all that a node of the site says."""
    own = part(site.system, "conform")
    return (*WATCHERS, *(own.WATCHERS if own is not None else ()))


def unlike(site: Site) -> list[str]:
    """The constants of the site for which the play was not written: what fails there may be the play's."""
    own = part(site.system, "conform")
    return [] if own is None else own.UNLIKE(site)
