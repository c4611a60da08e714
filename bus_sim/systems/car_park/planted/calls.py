"""Bugs in the negotiation: awards and bids."""

from collections.abc import Callable
from dataclasses import replace as changed
from typing import Any

from bus_sim.systems.car_park.planted.bug import PlantedBug
from bus_sim.systems.car_park.planted.tools import at_start, hearing, replace, saying
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import CallResult, KindCode
from onboard.contract.messages import Award, Bid, Message
from onboard.controller.shell import Controller


def _is_award(message: Message) -> bool:
    return isinstance(message, Award) and message.result is CallResult.AWARDED


def _silent_form(simulation: Simulation) -> None:
    """The seed papers' form: at the deadline everybody takes itself to know who has won."""

    def plant(controller: Controller) -> None:
        negotiation = controller.holon.negotiation
        negotiation.timing = changed(negotiation.timing, silent=True)

    at_start(simulation, None, plant)


def _takes_others_tasks(simulation: Simulation) -> None:
    def make_filter(controller: Controller) -> Callable[[Message], Message]:
        def hear(message: Message) -> Message:
            if isinstance(message, Award) and _is_award(message):
                return changed(message, winner=controller.holon.node_id)
            return message

        return hear

    hearing(simulation, KindCode.ROBOT, make_filter)
    _deaf_to_bids(simulation)


def _no_award(simulation: Simulation) -> None:
    saying(simulation, KindCode.COMPARTMENT, lambda message: [] if isinstance(message, Award) else [message])


def _awards_twice(simulation: Simulation) -> None:
    robots = [node for node, machine in simulation.site.machines.items() if machine.kind is KindCode.ROBOT]

    def say(message: Message) -> list[Message]:
        if not isinstance(message, Award) or not _is_award(message):
            return [message]
        other = next((node for node in robots if node != message.winner), message.winner + 1)
        return [message, changed(message, winner=other)]

    saying(simulation, KindCode.COMPARTMENT, say)


def _awards_whom_it_likes(simulation: Simulation) -> None:
    robots = [node for node, machine in simulation.site.machines.items() if machine.kind is KindCode.ROBOT]

    def say(message: Message) -> list[Message]:
        if isinstance(message, Award) and _is_award(message):
            return [changed(message, winner=robots[-1] if message.winner != robots[-1] else robots[0])]
        return [message]

    saying(simulation, KindCode.COMPARTMENT, say)


def _deaf_to_bids(simulation: Simulation) -> None:
    def make_filter(_: object) -> Callable[[Message], Message | None]:
        return lambda message: None if isinstance(message, Bid) and message.initiator < 5 else message

    hearing(simulation, KindCode.ROBOT, make_filter)


def _late_bids_count(simulation: Simulation) -> None:
    """An initiator waits longer than it said, and robots bid when it is too late."""
    late_us = 500_000

    def in_initiator(controller: Controller) -> None:
        negotiation = controller.holon.negotiation

        def make(old: Callable[..., Any]) -> Callable[..., Any]:
            def open_call(terms: Any, now_us: int) -> Any:
                effects = old(terms, now_us)
                initiator = negotiation.initiators[-1]
                initiator.due_us = (initiator.due_us or now_us) + late_us
                return effects

            return open_call

        replace(negotiation, "open", make)

    def in_bidder(controller: Controller) -> None:
        bus = controller.ports.fleet_bus
        window_us = simulation.site.timing.call_window_us

        def make(old: Callable[..., Any]) -> Callable[..., Any]:
            def send(frame: Any) -> Any:
                if (frame.arbitration_id & ~0xFF) != _BID_ID:
                    return old(frame)
                simulation.loop.call_later((window_us + late_us // 4) / 1e6, old, frame)
                return True

            return send

        replace(bus, "send", make)

    at_start(simulation, KindCode.COMPARTMENT, in_initiator)
    at_start(simulation, KindCode.ROBOT, in_bidder)


def _awards_the_worst(simulation: Simulation) -> None:
    """Everybody bids, and the initiator takes the larger cost for the better one."""
    _deaf_to_bids(simulation)

    def plant(controller: Controller) -> None:
        negotiation = controller.holon.negotiation

        def make(old: Callable[..., Any]) -> Callable[..., Any]:
            def receive(message: Message, now_us: int) -> Any:
                if isinstance(message, Bid):
                    return old(changed(message, cost=(1 << 31) - message.cost), now_us)
                return old(message, now_us)

            return receive

        replace(negotiation, "receive", make)

    at_start(simulation, KindCode.COMPARTMENT, plant)


#: Identifier of Bid without its sender (dbc/fleet.dbc).
_BID_ID = 2302214144 & 0x1FFFFFFF

BUGS = (
    PlantedBug("silent-form", "one-owner", "the award is believed and not said", _silent_form),
    PlantedBug("takes-others-tasks", "one-owner", "every robot takes an award for its own", _takes_others_tasks),
    PlantedBug("no-award", "calls-closed", "an initiator never says how its calls end", _no_award),
    PlantedBug("awards-twice", "calls-closed", "an initiator awards a task to two", _awards_twice),
    PlantedBug("awards-whom-it-likes", "bids-in-time", "an initiator awards one that never bid", _awards_whom_it_likes),
    PlantedBug("late-bids-count", "bids-in-time", "an initiator counts bids after its deadline", _late_bids_count),
    PlantedBug("deaf-to-bids", "bids-go-down", "robots bid though a better bid is on the bus", _deaf_to_bids),
    PlantedBug("awards-the-worst", "bids-go-down", "an initiator takes the worst bid for the best", _awards_the_worst),
)
