"""Bugs in authority: tokens doubled, motion without them or beyond them."""

from collections.abc import Callable
from typing import Any

from bus_sim.planted.bug import PlantedBug
from bus_sim.planted.tools import at_start, in_behaviour, replace
from bus_sim.run import Simulation
from onboard.controller.shell import Controller
from onboard.core.codes import KindCode, Reason, TokenKind


def _without_erasing(simulation: Simulation) -> None:
    def plant(controller: Controller) -> None:
        tokens = controller.holon.tokens

        def make(old: Callable[..., Any]) -> Callable[..., Any]:
            def give(key: Any, to: int, now_us: int) -> Any:
                version = tokens.held.get(key, tokens.seen.get(key, 0))
                effects = old(key, to, now_us)
                tokens.held[key] = version
                return effects

            return give

        replace(tokens, "give", make)

    at_start(simulation, None, plant)


def _steward_for_ever(simulation: Simulation) -> None:
    def plant(controller: Controller) -> None:
        tokens = controller.holon.tokens

        def make(old: Callable[..., bool]) -> Callable[..., bool]:
            # The site file says who holds a token at first; this one believes that for ever.
            return lambda key: old(key) or (
                key.kind is TokenKind.SEGMENT and controller.holon.site.stewards.get(key.number >> 8) == tokens.node_id
            )

        replace(tokens, "holds", make)

    at_start(simulation, KindCode.COMPARTMENT, plant)


def _unasked(simulation: Simulation) -> None:
    def plant(robot: Any) -> None:
        replace(robot.carriage, "_reach", lambda _: lambda ahead: (ahead[-1], Reason.NONE))

    in_behaviour(simulation, KindCode.ROBOT, plant)


def _a_point(simulation: Simulation) -> None:
    def plant(robot: Any) -> None:
        carriage = robot.carriage

        def occupied() -> Any:
            if carriage.sensed is None:
                return []
            return carriage.axis.overlapped(carriage.sensed.position_mm, carriage.sensed.position_mm)

        replace(carriage, "occupied", lambda _: occupied)

    in_behaviour(simulation, KindCode.ROBOT, plant)


def _grants_to_all(simulation: Simulation) -> None:
    """Stewards grant from the site file alone, and robots are not asked whether they are there."""
    _steward_for_ever(simulation)

    def plant(machine: Any) -> None:
        replace(machine, "may_grant", lambda _: lambda *_arguments: Reason.NONE)

    for kind in (KindCode.COMPARTMENT, KindCode.LIFT):
        in_behaviour(simulation, kind, plant)


BUGS = (
    PlantedBug("keeps-what-it-gives", "one-holder", "a token is given and not erased", _without_erasing),
    PlantedBug("steward-for-ever", "one-holder", "a steward believes that it holds what it gave away", _steward_for_ever),
    PlantedBug("drives-unasked", "inside-authority", "a robot drives to its goal, whatever it holds", _unasked),
    PlantedBug("body-is-a-point", "inside-authority", "a robot gives slots back while its rear is in", _a_point),
    PlantedBug("grants-to-all", "one-body", "stewards grant to whoever asks", _grants_to_all),
    PlantedBug("drives-through", "one-body", "robots drive to their goals, whoever is there", _unasked),
)
