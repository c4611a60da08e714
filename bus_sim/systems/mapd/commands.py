"""What ``bus-sim`` can do with sites of this system alone."""

from types import ModuleType

from bus_sim.commands import Command


def _import() -> ModuleType:
    from bus_sim.systems.mapd.importers import command

    return command


COMMANDS = {
    "import": Command("make a site file of a MAPF map, an openTCS model or an Open-RMF building", _import),
}
