"""Logs of short runs, made once for all tests that look at them."""

from functools import cache
from pathlib import Path

from bus_sim.cli import main
from bus_sim.sites import find_site
from onboard.contract.messages import Message
from onboard.trace.listener import Listener, LoggedMessage
from onboard.trace.readers.open_log import Log
from onboard.wire.codec import codecs
from tests.once import once

SITE_FILE = Path(__file__).parents[2] / "bus_sim" / "sites" / "small.toml"
SITE = find_site("small")


@cache
def run_log(*words: str, stay_s: int = 60) -> Path:
    """The log, device buses included, of one car that comes to the small site and is fetched, if faults let it."""
    options = ["--one-car", str(stay_s), "--speed", "max", "--devices", *words]

    def play(folder: Path) -> None:
        assert main(["run", "small", *options, "--trace", str(folder / "run.log")]) in (0, 1)

    return once("-".join(["small", *options]), play) / "run.log"


def key_log() -> Path:
    """The same where the key calls: the order of the paper's figure (row P50)."""

    def play(folder: Path) -> None:
        site = folder / "small.toml"
        site.write_text(SITE_FILE.read_text(encoding="utf-8") + '\n[negotiation]\ncall_at = "key"\n', encoding="utf-8")
        words = ["--one-car", "60", "--speed", "max", "--devices", "--trace", str(folder / "run.log")]
        assert main(["run", str(site), *words]) == 0

    return once("small-key", play) / "run.log"


def fleet_of(path: Path) -> list[LoggedMessage]:
    """All messages of the fleet bus."""
    with Log(str(path)) as log:
        return [said for said in Listener(codecs()).messages(log) if said.is_fleet]


def first(said: list[LoggedMessage], kind: type[Message]) -> LoggedMessage:
    """The first message of a kind."""
    return next(one for one in said if isinstance(one.message, kind))
