"""What a site is, in lines for a person: as its system's folder tells it (``report.py``), else its machines by kind."""

from onboard.core.site import Site
from onboard.systems.registry import part


def site_report(site: Site) -> list[str]:
    """The lines on a site."""
    module = part(site.system, "report")
    if module is not None:
        own: list[str] = module.lines(site)
        return own
    kinds = sorted({machine.kind for machine in site.machines.values()})
    names = {kind: [one.name for one in site.machines.values() if one.kind is kind] for kind in kinds}
    return [f"system: {site.system}", *(f"{kind.name.lower()}: {', '.join(names[kind])}" for kind in kinds)]
