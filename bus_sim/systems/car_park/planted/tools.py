"""How a bug is put into one run: a method of one object is replaced, or what a controller hears or says is changed.

Nothing here touches a class or a module, so a bug ends with its run.
"""

import dataclasses
from collections.abc import Callable, Iterable
from typing import Any

from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import KindCode, Reason
from onboard.contract.messages import Message
from onboard.controller.shell import Controller
from onboard.core.behaviour import Behaviour
from onboard.core.effects import Actuate, Effect, Send, Tell
from onboard.core.motion_authority import ALONE, Permit, authorised
from onboard.core.site import Segment

#: What is said instead of one message; an empty list says nothing.
Said = Callable[[Message], Iterable[Message]]
#: What is heard instead of one message; None hears nothing.
Heard = Callable[[Message], Message | None]


def replace(owner: object, method: str, make: Callable[[Any], Callable[..., Any]]) -> None:
    """Give one object another method: ``make`` gets the old one. Raises ``AttributeError`` where there is none."""
    setattr(owner, method, make(getattr(owner, method)))


def at_start(simulation: Simulation, kind: KindCode | None, plant: Callable[[Controller], None]) -> None:
    """Do something to every controller of a kind (None: all) each time that it is powered up, before it starts."""

    def on_controller(controller: Controller) -> None:
        if kind in (None, controller.holon.machine.kind):
            plant(controller)

    simulation.before_start.append(on_controller)


def in_behaviour(simulation: Simulation, kind: KindCode, plant: Callable[[Any], None]) -> None:
    """Do something to the behaviour of every machine of a kind, which does not look at its own orders either."""

    def broken(controller: Controller) -> None:
        plant(_behaviour(controller))
        motion = controller.holon.fleet.motion

        def looks_away(*_: object) -> None:
            motion.event += 1

        replace(motion, "fault", lambda _: looks_away)

    at_start(simulation, kind, broken)


def _behaviour(controller: Controller) -> Behaviour:
    return controller.holon.behaviour


def saying(simulation: Simulation, kind: KindCode | None, said: Said) -> None:
    """Change what controllers of a kind say, on the fleet bus and to their devices."""

    def changed(effects: list[Effect]) -> list[Effect]:
        result: list[Effect] = []
        for effect in effects:
            if isinstance(effect, Send | Actuate | Tell):
                result += [dataclasses.replace(effect, message=message) for message in said(effect.message)]
            else:
                result.append(effect)
        return result

    def plant(controller: Controller) -> None:
        for method in ("start", "receive", "sense", "wake"):
            replace(controller.holon, method, lambda old: lambda *arguments, **named: changed(old(*arguments, **named)))

    at_start(simulation, kind, plant)


def hearing(simulation: Simulation, kind: KindCode | None, heard: Callable[[Controller], Heard]) -> None:
    """Change what controllers of a kind hear, on the fleet bus and from their devices."""

    def plant(controller: Controller) -> None:
        message_filter = heard(controller)

        def changed(old: Callable[[Message, int], list[Effect]]) -> Callable[[Message, int], list[Effect]]:
            def hear(message: Message, now_us: int) -> list[Effect]:
                other = message_filter(message)
                return [] if other is None else old(other, now_us)

            return hear

        for method in ("receive", "sense"):
            replace(controller.holon, method, changed)

    at_start(simulation, kind, plant)


def reaches_goal(carriage: Any) -> Callable[[list[int]], tuple[Segment, Permit, Reason]]:
    """A carriage's reach where rights count for nothing: to the end of the way on its axis."""

    def reach(ahead: list[int]) -> tuple[Segment, Permit, Reason]:
        permit = dataclasses.replace(authorised(carriage.fleet.motion, ALONE), reason=Reason.NONE)
        return Segment(carriage.track, ahead[-1]), permit, Reason.NONE

    return reach
