"""Bugs in lifts and in riding them."""

# ruff: noqa: SLF001 - a bug sits inside a machine, where its own code reaches

from collections.abc import Callable
from dataclasses import replace as changed
from typing import Any

from bus_sim.systems.car_park.planted.bug import PlantedBug
from bus_sim.systems.car_park.planted.tools import hearing, in_behaviour, reaches_goal, replace
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import KindCode, Reason
from onboard.contract.messages import Message, PlatformState
from onboard.ways.lifts import gate


def _gate_forgotten(simulation: Simulation) -> None:
    """The lift takes its gate for its own, always."""

    def plant(lift: Any) -> None:
        tokens = lift.fleet.tokens
        number = gate(lift.track).number
        replace(tokens, "holds", lambda old: lambda key: key.number == number or old(key))
        # It still gives it away as it should: its mistake is about moving only.
        replace(tokens, "on_request", _really_held(tokens))

    in_behaviour(simulation, KindCode.LIFT, plant)


def _really_held(tokens: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    def make(old: Callable[..., Any]) -> Callable[..., Any]:
        def on_request(request: Any, verdict: Reason, now_us: int) -> Any:
            key = next((key for key in tokens.seen if key.number == request.token), None)
            if key is not None and key not in tokens.held:
                return []
            return old(request, verdict, now_us)

        return on_request

    return make


def _gate_any_time(simulation: Simulation) -> None:
    """The lift gives its gate to the robot aboard when it asks, and goes on."""
    _gate_forgotten(simulation)

    def plant(lift: Any) -> None:
        def may_have_gate(requester: int, _now_us: int) -> Reason:
            mine = lift.ride is not None and lift.ride.robot == requester
            lift._gate_was_out |= mine
            return Reason.NONE if mine else Reason.TOKEN_NOT_GRANTABLE_YET

        replace(lift, "_may_have_gate", lambda _: may_have_gate)

    in_behaviour(simulation, KindCode.LIFT, plant)


def _sees_everybody_aboard(simulation: Simulation) -> None:
    """The lift takes whoever has its gate for aboard, and moves while its robot comes over the sill."""
    _gate_forgotten(simulation)

    def make_filter(_: object) -> Callable[[Message], Message]:
        def hear(message: Message) -> Message:
            if isinstance(message, PlatformState):
                return changed(message, carrier_aboard=message.carrier_aboard or message.crossing, crossing=False)
            return message

        return hear

    hearing(simulation, KindCode.LIFT, make_filter)


def _and_no_curtain(simulation: Simulation) -> None:
    """The same, and the light curtain's wire to the drive is cut."""
    _sees_everybody_aboard(simulation)
    for drive in simulation.plant.lifts.values():
        replace(drive, "_refusal", lambda _: lambda _order: "")


def _platform_from_afar(simulation: Simulation) -> None:
    """Platform and gate are granted to the robot of the next ride wherever the lift is, and it asks for no proof."""

    def plant(lift: Any) -> None:
        replace(lift, "_stands_at", lambda old: lambda index: not lift._gate_was_out or old(index))

    in_behaviour(simulation, KindCode.LIFT, plant)
    in_behaviour(simulation, KindCode.ROBOT, _no_proof)


def _no_proof(robot: Any) -> None:
    """A robot takes the gate alone for proof that the platform is there."""
    replace(robot.carriage.sill, "lacks", lambda _: lambda _slot, _floor: Reason.NONE)
    replace(robot.carriage.sill, "refuse", lambda _: lambda _lift, _floor, _now_us: [])


def _leaves_at_any_floor(simulation: Simulation) -> None:
    """A robot takes its ride for over as soon as it gave the gate back."""

    def plant(robot: Any) -> None:
        riding = robot.riding

        def make(old: Callable[..., Any]) -> Callable[..., Any]:
            def advance(now_us: int) -> Any:
                effects = old(now_us)
                riding.done = riding._gate_returned
                return effects

            return advance

        replace(riding, "advance", make)
        replace(robot.carriage, "_reach", lambda _: reaches_goal(robot.carriage))

    in_behaviour(simulation, KindCode.ROBOT, plant)


BUGS = (
    PlantedBug("gate-forgotten", "lift-by-gate", "a lift moves though a robot has its gate", _gate_forgotten),
    PlantedBug("gate-any-time", "lift-by-gate", "a lift gives its gate away while it moves", _gate_any_time),
    PlantedBug("takes-all-for-aboard", "lift-crush", "a lift moves with its robot on the sill", _sees_everybody_aboard),
    PlantedBug("no-light-curtain", "lift-crush", "the same, and the curtain does not stop the drive", _and_no_curtain),
    PlantedBug("platform-from-afar", "platform-there", "a platform is granted at another floor", _platform_from_afar),
    PlantedBug("leaves-at-any-floor", "platform-there", "a robot leaves the platform on its way", _leaves_at_any_floor),
)
