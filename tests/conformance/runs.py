"""A short run of each system by the ordinary command, played once for all tests that look at its log."""

from contextlib import suppress
from functools import cache
from pathlib import Path

from bus_sim.cli import main
from bus_sim.sites import find_site
from onboard.core.site import Site
from onboard.operate.names import OperateError, movable_of
from tests.conformance.cases import CASES
from tests.once import once


@cache
def site_file(system: str) -> str:
    """A site of the system as commands take it: a name, or a file."""
    text = CASES[system].site
    if "\n" not in text:
        return text
    made = once(f"case-{system}", lambda folder: (folder / "site.toml").write_text(text, encoding="utf-8"))
    return str(made / "site.toml")


def site_of(system: str) -> Site:
    """The same, read."""
    return find_site(site_file(system))


def can_be_held(system: str) -> list[str]:
    """Names of the machines that a person may hold; desks, lathes and robots in step are none of them."""
    names = []
    for one in site_of(system).machines.values():
        with suppress(OperateError):
            names.append(movable_of(site_of(system), one.name).name)
    return names


def one_of_each_kind(system: str) -> list[str]:
    """The names of machines, one of each kind that the system has."""
    kinds = {machine.kind: machine.name for machine in reversed(site_of(system).machines.values())}
    return list(kinds.values())


@cache
def log_of(system: str) -> Path:
    """The log of a run in which nothing goes wrong, device buses included; its figures lie beside it as run.json."""
    words = [*CASES[system].options, "--seed", "1", "--speed", "max", "--no-web", "--devices"]

    def play(folder: Path) -> None:
        # 1: somebody still waits when the run ends by the clock.
        files = ["--trace", str(folder / "run.log"), "--json", str(folder / "run.json")]
        assert main(["run", site_file(system), *words, *files]) in (0, 1)

    return once(f"run-{system}", play) / "run.log"
