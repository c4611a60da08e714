"""One place makes the orders by which something moves, and what controllers say to devices is known to move or not."""

import ast
import re

from onboard.core.site import Site
from onboard.systems.registry import own_names, part
from tests.project.rows import ROOT

#: Where each of these is made, and nowhere else in the product: an order, what permits it, and what that looks at.
MADE_IN = {
    "Actuate": "onboard/core/motion_authority.py",
    "Permit": "onboard/core/motion_authority.py",
    "MotionAuthority": "onboard/core/behaviour.py",
}
#: What controllers say to devices by which nothing moves: words to people, a program that is loaded, a question.
STILL = {
    *("LightOrder", "DeskOrder", "OrderAnswer", "VisitAnswer", "MissionAnswer", "JobAnswer", "TransportAnswer"),
    *("ProgramText", "ProgramEnd", "StateRequest", "TicketPrint", "DeskFetchAnswer", "DeskPromise"),
}


def test_one_place_makes_it() -> None:
    files = [path for folder in ("onboard", "bus_sim", "hil", "deploy") for path in (ROOT / folder).rglob("*.py")]
    texts = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in files}
    makers = {
        (called, place)
        for place, text in texts.items()
        if any(name in text for name in MADE_IN)
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Call) and (called := _called(node.func)) in MADE_IN
    }
    assert makers == set(MADE_IN.items())


def _called(function: ast.expr) -> str:
    return function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")


def test_what_a_controller_says_to_its_devices_moves_something_or_is_known_not_to() -> None:
    said = {
        name
        for path in sorted((ROOT / "dbc").glob("*.dbc"))
        for name in re.findall(r"^BO_ \d+ (\w+): \d Controller$", path.read_text(encoding="utf-8"), re.MULTILINE)
    }
    modules = {module.__name__ for name in own_names() if (module := part(name, "site")) is not None}
    sites = [one for one in _kinds_of(Site) if one.__module__ in modules]
    moving = {name for site in sites for name in site.moved_by}
    assert len(sites) == len(own_names()) and all(site.moved_by for site in sites)
    assert said == moving | STILL and not moving & STILL


def _kinds_of(site: type[Site]) -> list[type[Site]]:
    """All classes below, at any depth."""
    below = site.__subclasses__()
    return below + [one for kind in below for one in _kinds_of(kind)]
