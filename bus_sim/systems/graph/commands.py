"""What ``bus-sim`` can do with sites of this system alone."""

from types import ModuleType

from bus_sim.commands import Command


def _certify() -> ModuleType:
    from bus_sim.systems.graph.certify import command

    return command


COMMANDS = {
    "certify": Command("can robots ever stick on a graph? and how many robots are best?", _certify),
}
