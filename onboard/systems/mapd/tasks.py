"""What is to be taken from where to where, on a floor of pick-up and delivery."""

from dataclasses import dataclass
from functools import lru_cache

#: Tasks of which is kept that they are the same: more than are open on a great floor.
MOST_KEPT = 4096


@dataclass(frozen=True, slots=True)
class TransportTask:
    """Take what is in cell ``pickup`` to cell ``delivery``; known from step ``release`` on."""

    number: int
    release: int
    pickup: int
    delivery: int


@lru_cache(maxsize=MOST_KEPT)
def task_named(number: int, release: int, pickup: int, delivery: int) -> TransportTask:
    """A task as all name it: one object in one process, so that two who know the same tasks are soon told so."""
    return TransportTask(number, release, pickup, delivery)
