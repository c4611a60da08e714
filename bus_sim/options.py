"""What a run was asked for: one class of options for every system, and for everybody who starts a run."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bus_sim.faults.injection import AnyFault
from bus_sim.processes.plan import ProcessPlan
from onboard.core.site import Site


@dataclass(frozen=True)
class RunOptions:
    """What ``bus-sim run`` was asked for, beside the site; see its help.

    ``speed`` is in simulated seconds a second, None for as fast as possible; ``epoch_us`` is the wall time (us since
    1970) of loop time 0, for the log's stamps. ``limit_s`` ends a run that does not end by itself.
    """

    seed: int = 1
    epoch_us: int = 0
    speed: float | None = None
    limit_s: float | None = None
    #: Who comes, in the words of the site's system; None for what a scenario without a word about it brings.
    demand: Any = None
    #: Machines whose controllers are left out: somebody else runs them, or nobody.
    without: frozenset[str] = frozenset()
    faults: tuple[AnyFault, ...] = ()
    #: The site file that machines begin with, where that of the run follows it, and when that is announced, s.
    was: Site | None = None
    change_s: float = 60.0
    #: Given the run before it is switched on: mistakes that are planted come in here.
    prepare: Callable[[Any], None] | None = None
    trace: Path | None = None
    #: Whether every machine's device bus is logged as well.
    devices: bool = False
    #: HOST:PORT of the socketcand server, None for none.
    serve: str | None = None
    #: The file of the token that its clients say; None where none is wanted.
    serve_token: Path | None = None
    buses: tuple[str, ...] = ()
    processes: ProcessPlan | None = None
    #: Where the page is served, PORT or HOST:PORT; None for no page.
    web: str | None = None
    #: The file of its token, so that the page's address outlives a run; None for another one each time.
    web_token: Path | None = None
    #: The broker that the site is published to, empty for one of the run's own; None for none. Goes with ``serve``.
    mqtt: str | None = None
    site_text: str = ""
    quiet: bool = False
