"""Bugs in authority: tokens doubled, motion without them or beyond them."""

from collections.abc import Callable
from dataclasses import replace as changed
from typing import Any

from bus_sim.systems.car_park.planted.bug import PlantedBug
from bus_sim.systems.car_park.planted.tools import at_start, hearing, in_behaviour, reaches_goal, replace, saying
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import KindCode, Reason, TokenKind
from onboard.contract.messages import CallForProposals, Itinerary, Message, Progress, TokenHeld
from onboard.controller.shell import Controller


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

    # Not in robots: they would give back for ever what they still hold.
    at_start(simulation, KindCode.COMPARTMENT, plant)
    _grants_segments(simulation)


def _grants_segments(simulation: Simulation) -> None:
    """Stewards grant segments that they take for their own to whoever asks."""

    def plant(machine: Any) -> None:
        def make(old: Callable[..., Reason]) -> Callable[..., Reason]:
            return lambda key, *rest: Reason.NONE if key.kind is TokenKind.SEGMENT else old(key, *rest)

        replace(machine, "may_grant", make)

    in_behaviour(simulation, KindCode.COMPARTMENT, plant)


def _alone(simulation: Simulation) -> None:
    """Robots plan as if they were alone, and those with even node-IDs answer no call: they stand in the way."""

    def make_filter(controller: Controller) -> Callable[[Message], Message | None]:
        stands = controller.holon.node_id % 2 == 0

        def hear(message: Message) -> Message | None:
            if isinstance(message, Itinerary | Progress):
                kind = simulation.site.machines[message.sender].kind
                return None if kind is KindCode.ROBOT else message
            return None if stands and isinstance(message, CallForProposals) else message

        return hear

    hearing(simulation, KindCode.ROBOT, make_filter)


def _sees_nobody(simulation: Simulation) -> None:
    """Robots plan as if they were alone, and drive whatever they hold."""
    _unasked(simulation)
    _alone(simulation)


def _never_given(simulation: Simulation) -> None:
    """A robot states every right that it gets under the next version as well."""

    def say(message: Message) -> list[Message]:
        return [message, changed(message, version=message.version + 1)] if isinstance(message, TokenHeld) else [message]

    saying(simulation, KindCode.ROBOT, say)


def _steward_for_ever(simulation: Simulation) -> None:
    def plant(controller: Controller) -> None:
        tokens = controller.holon.tokens

        def make(old: Callable[..., bool]) -> Callable[..., bool]:
            # The site file says who holds a token at first; this one believes that for ever.
            return lambda key: (
                old(key)
                or (
                    key.kind is TokenKind.SEGMENT
                    and controller.holon.site.stewards.get(key.number >> 8) == tokens.node_id
                )
            )

        replace(tokens, "holds", make)

    at_start(simulation, KindCode.COMPARTMENT, plant)
    _grants_segments(simulation)


def _unasked(simulation: Simulation) -> None:
    def plant(robot: Any) -> None:
        replace(robot.carriage, "_reach", lambda _: reaches_goal(robot.carriage))

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


def _others_are_mine(simulation: Simulation) -> None:
    """A steward takes slots that are others' for its own, and grants them."""
    _steward_for_ever(simulation)
    _alone(simulation)


def _all_is_mine(simulation: Simulation) -> None:
    """Robots take every slot for their own, and plan as if they were alone."""
    _alone(simulation)

    def plant(controller: Controller) -> None:
        replace(controller.holon.tokens, "holds", lambda old: lambda key: key.kind is TokenKind.SEGMENT or old(key))

    at_start(simulation, KindCode.ROBOT, plant)


BUGS = (
    PlantedBug("never-given", "one-holder", "a right is stated under a version that nobody gave", _never_given),
    PlantedBug("steward-for-ever", "one-holder", "a steward takes others' slots for its own", _others_are_mine),
    PlantedBug(
        "keeps-what-it-gives", "one-holder", "a compartment gives its bay and does not erase it", _without_erasing
    ),
    PlantedBug("drives-unasked", "inside-authority", "a robot drives to its goal, whatever it holds", _unasked),
    PlantedBug("body-is-a-point", "inside-authority", "a robot gives slots back while its rear is in", _a_point),
    PlantedBug("all-is-mine", "one-body", "robots take every slot for their own", _all_is_mine),
    PlantedBug("drives-through", "one-body", "robots plan and drive as if they were alone", _sees_nobody),
)
