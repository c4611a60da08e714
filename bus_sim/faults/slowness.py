"""A machine whose board is slow: its searches take virtual time, by their counted steps, so that runs repeat."""

from dataclasses import dataclass
from typing import Any, Final

from bus_sim.faults.controllers import machine_named
from bus_sim.faults.injection import Injection
from bus_sim.run import BusRun
from onboard.controller.shell import Controller
from onboard.ways.effort import SLICE_STEPS, Effort, Searching

#: What a step of a search takes where figures are measured, us: docs/figures.md says on which machine, and how much of
#: what bids and plans cost that accounts for. A board that is ``factor`` times as slow takes ``factor`` times as long.
STEP_US: Final = 15


@dataclass
class _Board:
    """A slow processor under one controller."""

    controller: Controller
    factor: float
    charged: int = 0

    def __post_init__(self) -> None:
        # What it has thought before it became slow took no time.
        self.charged = _effort_of(self.controller).steps

    def taken_us(self) -> int:
        """The time of all steps since this was asked last."""
        effort = _effort_of(self.controller)
        # A machine that has forgotten everything searches with a new count.
        effort.slice_steps = SLICE_STEPS
        steps = effort.steps - min(self.charged, effort.steps)
        self.charged = effort.steps
        return round(steps * STEP_US * self.factor)


def slow(simulation: BusRun[Any], injection: Injection) -> None:
    """Searching takes time, after restarts too: events wait while it is under way, and come in between its slices."""
    nodes = {machine_named(simulation, name).node_id for name in injection.target.split("|")}
    factor, lasts = injection.number("factor"), bool(injection.number("for_s"))

    def put_in(controller: Controller) -> None:
        if controller.holon.node_id in nodes:
            controller.taken_us = _Board(controller, factor).taken_us

    def heal() -> None:
        simulation.before_start.remove(put_in)
        for controller in simulation.controllers.values():
            if controller.holon.node_id in nodes:
                controller.taken_us = None
                _effort_of(controller).slice_steps = None

    simulation.before_start.append(put_in)
    for controller in simulation.controllers.values():
        put_in(controller)
    if lasts:
        simulation.plant.timers.call_at(injection.until_us, heal)


def _effort_of(controller: Controller) -> Effort:
    """What a machine's searches cost; of one that searches nothing, nothing."""
    estimator = controller.holon.negotiation.estimator
    return estimator.effort if isinstance(estimator, Searching) else Effort()
