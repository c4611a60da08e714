"""Where trials are played: this process, all cores of this machine, or the workers of a Dask scheduler; how far it is.

What a trial brings depends on its number alone, never on who played it; results come as they are ready.
"""

import argparse
import multiprocessing
import os
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Protocol, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from bus_sim.demand import DemandError

T = TypeVar("T")
R = TypeVar("R")


class Engine(Protocol):
    """Plays trials somewhere, in any order."""

    def __call__(self, function: Callable[[T], R], items: Sequence[T], /) -> Iterator[R]:
        """Results as they are ready."""


#: Trials that one task of a scheduler plays: a trial may take half a second, a task of Dask costs about a millisecond.
CHUNK = 8
#: How long a scheduler may take to answer, s.
ANSWER_S = 10


def on_cores(jobs: int, function: Callable[[T], R], items: Sequence[T]) -> Iterator[R]:
    """With one job in this process, else in so many fresh ones."""
    if jobs <= 1 or len(items) < 2:
        yield from map(function, items)
        return
    # A fresh interpreter each: nothing that this process has done can reach a trial.
    with multiprocessing.get_context("spawn").Pool(min(jobs, len(items))) as pool:
        yield from pool.imap_unordered(function, items)


def on_dask(address: str, function: Callable[[T], R], items: Sequence[T], chunk: int = CHUNK) -> Iterator[R]:
    """On the workers of the Dask scheduler at ``address``, such as ``tcp://10.0.0.5:8786``, ``chunk`` trials a task.

    The workers need this package, of the same version. Raises ``DemandError`` where Dask is not installed or no
    scheduler answers.
    """
    try:
        from distributed import Client, as_completed  # noqa: PLC0415  # an extra, and slow to import
    except ImportError as error:
        raise DemandError("--dask needs the extra campaign: pip install 'onboard-fleet[campaign]'") from error
    try:
        client = Client(address, timeout=ANSWER_S, set_as_default=False)  # type: ignore[no-untyped-call]  # Dask is not typed
    except (OSError, ValueError) as error:
        raise DemandError(f"--dask {address}: no Dask scheduler answers there ({error})") from error
    with client:
        chunks = [list(items[begin : begin + chunk]) for begin in range(0, len(items), chunk)]
        futures = [client.submit(_play_all, function, chunk, pure=False) for chunk in chunks]
        for future in as_completed(futures, loop=client.loop):  # type: ignore[no-untyped-call]  # Dask is not typed
            yield from future.result()


def _play_all(function: Callable[[T], R], items: Sequence[T]) -> list[R]:
    return [function(item) for item in items]


def add_where_options(parser: argparse.ArgumentParser) -> None:
    """Add where trials are played: a scheduler's workers, or so many processes."""
    parser.add_argument("--dask", metavar="ADDRESS", help="on the workers of a Dask scheduler, such as tcp://host:8786")
    parser.add_argument("--jobs", type=int, default=0, metavar="N", help="processes (default: one a core)")


def engine_of(args: argparse.Namespace, chunk: int = CHUNK) -> Engine:
    """Where trials are played by these options, ``chunk`` of them a task of a scheduler. Raises ``DemandError``."""
    if args.jobs < 0:
        raise DemandError(f"--jobs {args.jobs}: must be 1 or more; leave it out for one a core")
    if args.dask:
        return partial(on_dask, args.dask, chunk=chunk)
    return partial(on_cores, args.jobs or os.cpu_count() or 1)


def shown(results: Iterator[R], total: int, what: str, console: Console) -> Iterator[R]:
    """The same results, with a bar in a terminal that says how many of ``total`` are there."""
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task(what, total=total)
        for result in results:
            progress.advance(task)
            yield result
