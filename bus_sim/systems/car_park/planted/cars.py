"""Bugs about cars: put where another is, stated by the wrong machine or not at all, torn."""

# ruff: noqa: SLF001 - a bug sits inside a machine, where its own code reaches

from collections.abc import Callable
from dataclasses import replace as changed
from typing import Any

from bus_sim.systems.car_park.planted.bug import PlantedBug
from bus_sim.systems.car_park.planted.tools import in_behaviour, replace, saying
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import KindCode, ShuttleAction, TokenKind
from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import CarAt, Message, ShuttleOrder, TokenGrant
from onboard.core.effects import Send
from onboard.systems.car_park.program import HandlingPhase
from onboard.systems.car_park.site import car_park
from onboard.ways.tokens import car_token


def _all_in_one_place(simulation: Simulation) -> None:
    """Robots say of every car that they leave that it stands in the first place."""
    first = car_park(simulation.site).places[0].number

    def say(message: Message) -> list[Message]:
        is_left = isinstance(message, CarAt) and message.station not in (ANY_STATION, OUTSIDE)
        return [changed(message, station=first)] if isinstance(message, CarAt) and is_left else [message]

    saying(simulation, KindCode.ROBOT, say)


def _not_said_aboard(simulation: Simulation) -> None:
    def say(message: Message) -> list[Message]:
        return [] if isinstance(message, CarAt) and message.station == ANY_STATION else [message]

    saying(simulation, KindCode.ROBOT, say)


def _custody_first(simulation: Simulation) -> None:
    """A robot passes the custody of a car on, and states afterwards where it is."""

    def say(message: Message) -> list[Message]:
        if isinstance(message, CarAt) and message.station != ANY_STATION:
            return [changed(message, version=message.version + 1)]
        return [message]

    saying(simulation, KindCode.ROBOT, say)


def _everybodys_car(simulation: Simulation) -> None:
    """A compartment states every car whose token it hears of, whoever got it."""

    def plant(compartment: Any) -> None:
        fleet = compartment.fleet

        def make(old: Callable[..., Any]) -> Callable[..., Any]:
            def hear(message: Message, now_us: int) -> Any:
                effects = old(message, now_us)
                if isinstance(message, TokenGrant) and message.token_kind is TokenKind.CAR:
                    for car, record in fleet.mirror.cars.items():
                        if car_token(*car).number == message.token:
                            said = CarAt(fleet.node_id, car, record.station, message.version, record.wheelbase_mm)
                            effects = [*effects, Send(said)]
                return effects

            return hear

        replace(compartment, "hear", make)

    in_behaviour(simulation, KindCode.ROBOT, lambda robot: replace(robot.going_around.places, "lost", lambda _: list))
    for kind in (KindCode.COMPARTMENT, KindCode.LIFT):
        in_behaviour(simulation, kind, plant)


def _one_size(simulation: Simulation) -> None:
    """The shuttle is set to the shortest wheelbase, whatever the car's."""
    shortest_mm = car_park(simulation.site).cars.min_wheelbase_mm

    def say(message: Message) -> list[Message]:
        if isinstance(message, ShuttleOrder) and message.action is ShuttleAction.GRIP:
            return [changed(message, wheelbase_mm=shortest_mm)]
        return [message]

    saying(simulation, KindCode.ROBOT, say)
    for shuttle in simulation.plant.shuttles.values():
        # The telescope does not notice that the axles are elsewhere.
        shuttle._gripped = shuttle._lift  # type: ignore[method-assign]  # one object of one run


def _drives_off(simulation: Simulation) -> None:
    """A robot takes its shuttle for home as soon as that was told to come home."""

    def plant(robot: Any) -> None:
        shuttle = robot.shuttle

        def make(old: Callable[..., Any]) -> Callable[..., Any]:
            def advance(now_us: int) -> Any:
                effects = old(now_us)
                if shuttle.phase is HandlingPhase.RETRACT:
                    effects = [*effects, *shuttle._next(now_us)]
                return effects

            return advance

        replace(shuttle, "advance", make)

    in_behaviour(simulation, KindCode.ROBOT, plant)


def _and_no_home_switch(simulation: Simulation) -> None:
    """The same, and the home switch's wire to the drive is cut."""
    _drives_off(simulation)
    for carrier in simulation.plant.carriers.values():
        replace(carrier, "_shuttle_home", lambda _: lambda: True)


BUGS = (
    PlantedBug("all-in-one-place", "cars-conserved", "all cars are said to stand in one place", _all_in_one_place),
    PlantedBug("not-said-aboard", "cars-conserved", "robots do not say that they took a car", _not_said_aboard),
    PlantedBug("custody-first", "one-custodian", "a car is stated under a version passed on", _custody_first),
    PlantedBug("everybodys-car", "one-custodian", "fixed machines state cars that are not theirs", _everybodys_car),
    PlantedBug("one-size", "torn-car", "cars are gripped at one wheelbase", _one_size),
    PlantedBug("drives-off", "torn-car", "a robot drives before its shuttle is home", _drives_off),
    PlantedBug("no-home-switch", "torn-car", "the same, and the switch does not stop the drive", _and_no_home_switch),
)
