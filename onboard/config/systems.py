"""How the site files of all systems but the car park are read: the one place to add a system's reader.

A reader takes the whole document and what every site has. It notes every mistake in ``root.problems`` and returns what
it made of the rest, with digest 0: the caller raises, refuses unknown keys and works out the digest.
"""

from collections.abc import Callable
from typing import NamedTuple

from onboard.config.reader import Table
from onboard.core.site import Site
from onboard.systems.cell.reader import read_cell
from onboard.systems.graph.reader import read_graph
from onboard.systems.mapd.reader import read_mapd
from onboard.systems.terminal.reader import read_terminal
from onboard.systems.turning.reader import read_turning


class Common(NamedTuple):
    """What is read of every site file first: its name, and the fleet bus's bit/s."""

    name: str
    bitrate: int


#: By the word after ``system =`` in the table ``[site]``.
READERS: dict[str, Callable[[Table, Common], Site]] = {
    "terminal": read_terminal,
    "cell": read_cell,
    "graph": read_graph,
    "mapd": read_mapd,
    "turning": read_turning,
}
