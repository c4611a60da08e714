"""At every start: has the system on trial shown that it works, or did the board come back from one that had not?"""

from collections.abc import Callable
from dataclasses import dataclass

from deploy.update.board import BoardFiles
from deploy.update.slots import BoardEvent, after


@dataclass(frozen=True, slots=True)
class BootVerdict:
    """One line for the console, "" where there is nothing to say, and whether this system may stay."""

    line: str = ""
    is_good: bool = True


def judge(place: BoardFiles, is_healthy: Callable[[], bool]) -> BootVerdict:
    """Settle what is to be settled. ``is_healthy`` waits, and is asked of a system on trial only."""
    state, version = place.state(), place.itself().version
    if place.running == state.trial:
        if not is_healthy():
            _settle(place, BoardEvent.UNHEALTHY)
            return BootVerdict(
                f"version {version} in slot {state.trial} is not healthy; back to slot {state.good}", False
            )
        _settle(place, BoardEvent.HEALTHY)
        return BootVerdict(f"version {version} in slot {state.trial} is healthy, and stays")
    if state.trial:
        _settle(place, BoardEvent.FELL_BACK)
        return BootVerdict(f"version {state.version} did not work and is given up; version {version} runs again")
    return BootVerdict()


def _settle(place: BoardFiles, event: BoardEvent) -> None:
    with place.writable():
        place.keep(after(place.state(), event))
