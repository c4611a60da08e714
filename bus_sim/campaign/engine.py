"""Where trials are played: this process, all cores of this machine, or the workers of a Dask scheduler.

What a trial brings depends on its number alone, never on who played it; results come as they are ready.
"""

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

from bus_sim.demand import DemandError

T = TypeVar("T")
R = TypeVar("R")
Engine = Callable[[Callable[[T], R], Sequence[T]], Iterator[R]]

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


def on_dask(address: str, function: Callable[[T], R], items: Sequence[T]) -> Iterator[R]:
    """On the workers of the Dask scheduler at ``address``, such as ``tcp://10.0.0.5:8786``.

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
        chunks = [list(items[begin : begin + CHUNK]) for begin in range(0, len(items), CHUNK)]
        futures = [client.submit(_play_all, function, chunk, pure=False) for chunk in chunks]
        for future in as_completed(futures, loop=client.loop):  # type: ignore[no-untyped-call]  # Dask is not typed
            yield from future.result()


def _play_all(function: Callable[[T], R], items: Sequence[T]) -> list[R]:
    return [function(item) for item in items]
