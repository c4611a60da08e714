"""Logs of short runs of all systems, made once for all tests that show them."""

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

from bus_sim.sites import find_site
from onboard.contract.messages import Message
from onboard.core.site import Site
from onboard.systems.contract import codecs_for
from onboard.trace.listener import Listener
from onboard.trace.raw import RawFrame
from onboard.trace.readers.open_log import Log
from onboard.web.film import Film
from onboard.wire.codec import Codecs
from tests.mapd.sites import drawn, site_text
from tests.once import once

ROOT = Path(__file__).parents[2]
SITE_FILES = ROOT / "bus_sim" / "sites"
#: Sites of a folder of their own.
_LAYOUTS = ("twin",)
#: What a site's run is asked for, where it is not its own day.
_WORDS = {
    "standard": ["--random", "20", "5", "--cars", "8", "--for", "420"],
    "small": ["--one-car", "60"],
    "twin": ["--one-car", "60", "--for", "15"],
    "turning": ["--for", "900"],
}
#: Where no site of a system ships, one that is made for tests.
_MADE = {"mapd": lambda: site_text(4, drawn(8, 5))}


@cache
def file_of(name: str) -> Path:
    """The site file of a shipped site, or of one that is made."""
    if name not in _MADE:
        return SITE_FILES / ("layouts" if name in _LAYOUTS else "") / f"{name}.toml"

    def write(folder: Path) -> None:
        (folder / f"{name}.toml").write_text(_MADE[name](), encoding="utf-8")

    return once(f"shown-{name}", write) / f"{name}.toml"


@cache
def log_of(name: str) -> Path:
    """The log of a run of a shipped site, device buses included."""
    words = ["run", str(file_of(name)), *_WORDS.get(name, []), "--trace", "run.log", "--devices"]
    # In a process of its own: a browser's loop may run in this one.
    words = [sys.executable, "-m", "bus_sim.cli", *words]

    def play(folder: Path) -> None:
        played = subprocess.run(words, cwd=folder, env=environment(), capture_output=True, check=False)
        assert played.returncode in (0, 1), played.stderr

    return once(f"film-{name}", play) / "run.log"


def environment() -> dict[str, str]:
    """What a program of this tree is started with."""
    return {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200"}


def contract(site: Site) -> Codecs:
    """What is said on a site's buses."""
    return codecs_for(site)


def film_of(name: str, path: Path | None = None, *, fleet_only: bool = False) -> Film:
    """The film of a run; ``fleet_only`` as one sees it who hears no device bus."""
    site = find_site(str(file_of(name)))
    film = Film(site, contract(site))
    with Log(str(path or log_of(name))) as log:
        film.read(raw for raw in log if not fleet_only or raw.channel == "fleet")
    return film


@cache
def said_in(name: str) -> list[tuple[int, bool, Message]]:
    """All messages of a run: time in us of the log, whether it was the fleet bus, and what."""
    listener, found = Listener(contract(find_site(str(file_of(name))))), []
    with Log(str(log_of(name))) as log:
        for raw in log:
            heard = listener.hear(raw)
            if heard.message is not None:
                found.append((raw.time_us, heard.is_fleet, heard.message))
    return found


def frames_of(name: str) -> list[RawFrame]:
    """All frames of a run."""
    with Log(str(log_of(name))) as log:
        return list(log)
