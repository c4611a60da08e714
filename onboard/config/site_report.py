"""What a site is, in lines for a person: as its system's folder tells it (``report.py``), else its machines by kind."""

from collections.abc import Mapping

from onboard.contract.codes import KindCode
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


def machines_line(site: Site, kinds: Mapping[KindCode, str]) -> str:
    """How many machines of each kind there are, in the order of ``kinds``, by their names; none are left out."""
    named = {kind: [one.name for one in site.machines.values() if one.kind is kind] for kind in kinds}
    words = (f"{counted(len(names), kinds[kind])} ({', '.join(names)})" for kind, names in named.items() if names)
    return f"machines: {', '.join(words)}"


def counted(count: int, word: str) -> str:
    """A number with its noun, of which the plural ends in s."""
    return f"{count} {word}{'' if count == 1 else 's'}"
