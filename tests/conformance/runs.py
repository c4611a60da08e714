"""A short run of each system by the ordinary command, played once for all tests that look at its log."""

from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from bus_sim.cli import main
from bus_sim.sites import find_site
from onboard.core.site import Site
from tests.conformance.cases import CASES


@cache
def folder_of(system: str) -> Path:
    """Where what is made of a system lies."""
    return Path(mkdtemp(prefix=f"every-{system}-"))


@cache
def site_file(system: str) -> str:
    """A site of the system as commands take it: a name, or a file."""
    text = CASES[system].site
    if "\n" not in text:
        return text
    path = folder_of(system) / "site.toml"
    path.write_text(text, encoding="utf-8")
    return str(path)


def site_of(system: str) -> Site:
    """The same, read."""
    return find_site(site_file(system))


def one_of_each_kind(system: str) -> list[str]:
    """The names of machines, one of each kind that the system has."""
    kinds = {machine.kind: machine.name for machine in reversed(site_of(system).machines.values())}
    return list(kinds.values())


@cache
def log_of(system: str) -> Path:
    """The log of a run in which nothing goes wrong, device buses included; its figures lie beside it as run.json."""
    log = folder_of(system) / "run.log"
    words = [*CASES[system].options, "--seed", "1", "--speed", "max", "--no-web", "--devices"]
    # 1: somebody still waits when the run ends by the clock.
    status = main(["run", site_file(system), *words, "--trace", str(log), "--json", str(log.with_suffix(".json"))])
    assert status in (0, 1)
    return log
