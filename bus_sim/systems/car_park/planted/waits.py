"""Bugs that let a machine wait for ever."""

# ruff: noqa: SLF001 - a bug sits inside a machine, where its own code reaches

from collections.abc import Callable
from typing import Any

from bus_sim.systems.car_park.planted.bug import PlantedBug
from bus_sim.systems.car_park.planted.tools import in_behaviour, replace
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import CallResult, KindCode, ManualMode, Reason, TaskPhase, TokenKind
from onboard.contract.messages import ManualOrder, TaskReport
from onboard.core.effects import Effect, Send
from onboard.core.negotiation import Awarded, Closed
from onboard.wire.codec import fleet_codec

#: The node-ID of a person's tool (251 to 255).
_PERSON = 254


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


def _takes_itself_for_held(simulation: Simulation) -> None:
    """As if the journal had an order that nobody gave."""

    def plant(robot: Any) -> None:
        robot.holding.manual.mode = ManualMode.HELD

    in_behaviour(simulation, KindCode.ROBOT, plant)


def _deaf_to_the_end_of_a_hold(simulation: Simulation) -> None:
    """A person holds a robot for ten seconds; it takes no order to go on."""

    def plant(robot: Any) -> None:
        def make(old: Callable[[ManualOrder], list[Effect]]) -> Callable[[ManualOrder], list[Effect]]:
            return lambda order: [] if order.manual_mode is ManualMode.AUTOMATIC else old(order)

        replace(robot.holding, "ordered", make)

    in_behaviour(simulation, KindCode.ROBOT, plant)
    _person_says(simulation, (20.0, 1, ManualMode.HELD), (30.0, 2, ManualMode.AUTOMATIC))


def _person_says(simulation: Simulation, *orders: tuple[float, int, ManualMode]) -> None:
    """To the first robot, each at its time in s of loop time, under its number."""
    robots = [node for node, one in simulation.site.machines.items() if one.kind is KindCode.ROBOT]
    bus, codec = simulation.fleet.attach("person", _PERSON), fleet_codec()

    def say(number: int, mode: ManualMode) -> None:
        for frame in codec.encode(ManualOrder(_PERSON, robots[0], number, mode)):
            bus.send(frame)

    for at_s, number, mode in orders:
        simulation.loop.call_at(at_s, say, number, mode)


def _takes_no_order(*, answers: bool) -> Callable[[Simulation], None]:
    """A person tries ten times to hold a robot, which answers nothing, or what it was told last."""

    def plant_in(simulation: Simulation) -> None:
        def plant(robot: Any) -> None:
            replace(robot.holding, "ordered", lambda _: lambda _: [robot.holding.manual.report()] if answers else [])

        in_behaviour(simulation, KindCode.ROBOT, plant)
        _person_says(simulation, *((20.0 + second, 1, ManualMode.HELD) for second in range(10)))

    return plant_in


def _nobody_is_left_out(simulation: Simulation) -> None:
    def plant(desk: Any) -> None:
        replace(desk.fleet.negotiation.trust, "left_out", lambda _: lambda *_a, **_k: frozenset())

    in_behaviour(simulation, KindCode.COMPARTMENT, plant)


def _gives_all_back(simulation: Simulation) -> None:
    """Robots give back whatever they win, and nobody remembers who did."""

    def plant(robot: Any) -> None:
        def make(old: Callable[..., list[Effect]]) -> Callable[..., list[Effect]]:
            def negotiated(event: Any, now_us: int) -> list[Effect]:
                if not isinstance(event, Awarded):
                    return old(event, now_us)
                robot.generation.tentative.clear()
                task = event.call.task
                return [Send(TaskReport(robot.fleet.node_id, task, TaskPhase.FORFEITED, 0, Reason.CANCELLED))]

            return negotiated

        replace(robot, "negotiated", make)

    in_behaviour(simulation, KindCode.ROBOT, plant)
    _nobody_is_left_out(simulation)


def _never_content(simulation: Simulation) -> None:
    """A compartment calls anew for what has just found its machine, and leaves nobody out."""
    _nobody_is_left_out(simulation)

    def plant(desk: Any) -> None:
        def make(old: Callable[..., list[Effect]]) -> Callable[..., list[Effect]]:
            def negotiated(event: Any, now_us: int) -> list[Effect]:
                effects = old(event, now_us)
                if isinstance(event, Closed) and event.result is CallResult.AWARDED and desk.job is not None:
                    effects += desk.calls.call_again(desk.job, now_us)
                return effects

            return negotiated

        replace(desk, "negotiated", make)

    in_behaviour(simulation, KindCode.COMPARTMENT, plant)


BUGS = (
    PlantedBug("segments-kept", "nobody-starves", "a steward never grants", _never_to_robots),
    PlantedBug("lift-never-comes", "nobody-starves", "lifts promise rides and stay where they are", _lift_never_comes),
    PlantedBug("held-by-nobody", "let-go-again", "robots take themselves for held", _takes_itself_for_held),
    PlantedBug(
        "deaf-to-going-on", "let-go-again", "a held robot does not hear that it may go on", _deaf_to_the_end_of_a_hold
    ),
    PlantedBug("deaf-to-a-hand", "hold-answered", "robots hear no order by hand", _takes_no_order(answers=False)),
    PlantedBug(
        "answers-another-hand",
        "hold-answered",
        "robots answer an order by hand as if it were the one before",
        _takes_no_order(answers=True),
    ),
    PlantedBug(
        "gives-all-back", "no-rounds", "robots give back what they win, and nobody remembers it", _gives_all_back
    ),
    PlantedBug("never-content", "no-rounds", "a compartment calls anew for what has found its machine", _never_content),
)
