"""Bugs at compartments: doors, words for customers, tasks that come to nothing."""

# ruff: noqa: SLF001 - a bug sits inside a machine, where its own code reaches

from collections.abc import Callable, Iterable
from dataclasses import replace as changed
from typing import Any

from bus_sim.systems.car_park.planted.bug import PlantedBug
from bus_sim.systems.car_park.planted.tools import at_start, hearing, in_behaviour, replace, saying
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import CallResult, DeskInput, DeskText, DoorPosition, KindCode, Reason, TaskPhase, TokenKind
from onboard.contract.messages import Award, BayState, DeskEvent, DeskOrder, DoorState, DriveOrder, Message, TaskReport
from onboard.controller.shell import Controller
from onboard.ways.mirror import way_mirror

_TASK_WORDS = (DeskText.TAKE_TICKET, DeskText.FULL, DeskText.CAR_TOO_LARGE, DeskText.NO_CHARGING)


def _closing_is_locked(simulation: Simulation) -> None:
    """The seed paper's order: the output door opens as soon as the input door begins to close."""

    def make_filter(_: object) -> Callable[[Message], Message]:
        def hear(message: Message) -> Message:
            if isinstance(message, DoorState) and message.input_door is DoorPosition.CLOSING:
                return changed(message, input_door=DoorPosition.LOCKED)
            return message

        return hear

    hearing(simulation, KindCode.COMPARTMENT, make_filter)

    def plant(compartment: Any) -> None:
        compartment._robot_waits = True

        def make(old: Callable[..., Any]) -> Callable[..., Any]:
            def when_awaiting(now_us: int) -> Any:
                # It does not wait for the robot either.
                compartment._robot_waits = True
                return old(now_us)

            return when_awaiting

        for phase, step in list(compartment._table.items()):
            if phase.name == "AWAITING":
                compartment._table[phase] = make(step)
        replace(compartment, "_when_awaiting", make)

    in_behaviour(simulation, KindCode.COMPARTMENT, plant)


def _and_no_interlock(simulation: Simulation) -> None:
    """The same, and the doors' own interlock is bridged."""
    _closing_is_locked(simulation)
    for compartment in simulation.plant.compartments.values():
        for door in compartment.doors.values():
            replace(door, "_may_open", lambda _: lambda: True)


def _without_word(simulation: Simulation) -> None:
    def say(message: Message) -> list[Message]:
        return [] if isinstance(message, DeskOrder) and message.text in _TASK_WORDS else [message]

    saying(simulation, KindCode.COMPARTMENT, say)


def _tickets_lost(simulation: Simulation) -> None:
    def make_filter(_: object) -> Callable[[Message], Message | None]:
        lost = (DeskInput.TICKET, DeskInput.CANCEL)
        return lambda message: None if isinstance(message, DeskEvent) and message.event in lost else message

    hearing(simulation, KindCode.COMPARTMENT, make_filter)


def _full_too_soon(simulation: Simulation) -> None:
    """A park counts as full with one car in it."""

    def plant(controller: Controller) -> None:
        mirror = way_mirror(controller.holon.mirror)

        def make(old: Callable[..., list[Any]]) -> Callable[..., list[Any]]:
            return lambda *arguments, **named: [] if mirror.cars else old(*arguments, **named)

        replace(mirror, "free_places", make)

    at_start(simulation, KindCode.COMPARTMENT, plant)


def _always_full(simulation: Simulation) -> None:
    def say(message: Message) -> list[Message]:
        if isinstance(message, DeskOrder) and message.text is DeskText.TAKE_TICKET:
            return [message, changed(message, text=DeskText.FULL)]
        return [message]

    saying(simulation, KindCode.COMPARTMENT, say)


def _places_kept(simulation: Simulation) -> None:
    """Stewards give nobody the right to a place."""

    def keep(old: Callable[..., Reason]) -> Callable[..., Reason]:
        return lambda key, *rest: Reason.TOKEN_HELD_BY_OTHER if key.kind is TokenKind.STATION else old(key, *rest)

    for kind in (KindCode.COMPARTMENT, KindCode.LIFT):
        in_behaviour(simulation, kind, lambda steward: replace(steward.stewardship, "may_grant", keep))


def _drives_dead(simulation: Simulation) -> None:
    """No drive hears its orders, and no robot notices."""

    def say(message: Message) -> Iterable[Message]:
        return [] if isinstance(message, DriveOrder) else [message]

    saying(simulation, KindCode.ROBOT, say)
    in_behaviour(
        simulation,
        KindCode.ROBOT,
        lambda robot: replace(robot.carriage.stall, "is_stuck", lambda _: lambda _now_us: False),
    )


def _refused_without_why(simulation: Simulation) -> None:
    """Nobody answers, and the refusal that follows has no reason."""

    def make_filter(_: object) -> Callable[[Message], Message | None]:
        return lambda message: None if type(message).__name__ == "CallForProposals" else message

    hearing(simulation, KindCode.ROBOT, make_filter)

    def say(message: Message) -> list[Message]:
        if isinstance(message, TaskReport) and message.phase is TaskPhase.REFUSED:
            return [changed(message, reason=Reason.NONE)]
        return [message]

    saying(simulation, KindCode.COMPARTMENT, say)


def _forgets_its_award(simulation: Simulation) -> None:
    """A robot forgets what it won, and no desk tells that its task came to nothing."""

    def make_filter(_: object) -> Callable[[Message], Message | None]:
        def hear(message: Message) -> Message | None:
            return None if isinstance(message, Award) and message.result is CallResult.AWARDED else message

        return hear

    hearing(simulation, KindCode.ROBOT, make_filter)
    saying(simulation, KindCode.COMPARTMENT, lambda message: [] if _is_an_end(message) else [message])


def _is_an_end(message: Message) -> bool:
    if isinstance(message, TaskReport):
        return message.phase is TaskPhase.REFUSED
    return isinstance(message, Award) and message.result is not CallResult.AWARDED


def _blind_to_persons(simulation: Simulation) -> None:
    """The bay's sensor for persons is dead, for the controller and for both doors."""
    for compartment in simulation.plant.compartments.values():
        for door in compartment.doors.values():
            replace(door, "_is_clear", lambda _: lambda: True)
            replace(door, "_may_open", lambda _: lambda: True)

    def make_filter(_: object) -> Callable[[Message], Message]:
        def hear(message: Message) -> Message:
            return changed(message, person_inside=False) if isinstance(message, BayState) else message

        return hear

    hearing(simulation, KindCode.COMPARTMENT, make_filter)


BUGS = (
    PlantedBug("closing-is-locked", "doors", "the output door opens before the input is locked", _closing_is_locked),
    PlantedBug("no-door-interlock", "doors", "the same, and the doors obey", _and_no_interlock),
    PlantedBug("blind-to-persons", "doors", "a bay is closed and opened on a person", _blind_to_persons),
    PlantedBug("without-a-word", "customers-served", "a desk never answers the key", _without_word),
    PlantedBug("tickets-lost", "customers-served", "a desk loses tickets", _tickets_lost),
    PlantedBug("full-too-soon", "full-means-full", "a park with one car is called full", _full_too_soon),
    PlantedBug("always-full", "full-means-full", "a desk says FULL to everybody", _always_full),
    PlantedBug("places-kept", "something-happens", "stewards give nobody the right to a place", _places_kept),
    PlantedBug("drives-dead", "something-happens", "no drive gets its orders", _drives_dead),
    PlantedBug("refused-without-why", "tasks-served", "a task is refused without a reason", _refused_without_why),
    PlantedBug("forgets-its-award", "tasks-served", "awards are never acted upon", _forgets_its_award),
)
