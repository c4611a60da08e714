"""What ``bus-sim`` can do with sites of this system alone."""

from types import ModuleType

from bus_sim.commands import Command


def _compare() -> ModuleType:
    from bus_sim.systems.car_park.compare import command

    return command


def _design() -> ModuleType:
    from bus_sim.systems.car_park.design import command

    return command


COMMANDS = {
    "compare": Command("our protocol beside central dispatchers, a bound and an optimum", _compare),
    "design": Command("how many robots, lifts and compartments a demand needs", _design),
}
