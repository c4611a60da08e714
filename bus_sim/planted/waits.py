"""Bugs that let a machine wait for ever."""

# ruff: noqa: SLF001 - a bug sits inside a machine, where its own code reaches

from collections.abc import Callable
from typing import Any

from bus_sim.planted.bug import PlantedBug
from bus_sim.planted.tools import in_behaviour, replace
from bus_sim.run import Simulation
from onboard.core.codes import KindCode, Reason, TokenKind


def _never_to_robots(simulation: Simulation) -> None:
    """Stewards never grant a segment of the street's alley."""

    def plant(machine: Any) -> None:
        def make(old: Callable[..., Reason]) -> Callable[..., Reason]:
            def may_grant(key: Any, requester: int, now_us: int) -> Reason:
                if key.kind is TokenKind.SEGMENT and key.number >> 8 == 1:
                    return Reason.TOKEN_NOT_GRANTABLE_YET
                return old(key, requester, now_us)

            return may_grant

        replace(machine, "may_grant", make)

    for kind in (KindCode.COMPARTMENT, KindCode.LIFT):
        in_behaviour(simulation, kind, plant)


def _lift_never_comes(simulation: Simulation) -> None:
    def plant(lift: Any) -> None:
        replace(lift, "_go", lambda _: lambda _index, _now_us: lift._stand())

    in_behaviour(simulation, KindCode.LIFT, plant)


BUGS = (
    PlantedBug("segments-kept", "nobody-starves", "a steward never grants", _never_to_robots),
    PlantedBug("lift-never-comes", "nobody-starves", "lifts promise rides and stay where they are", _lift_never_comes),
)
