"""The terminal's page: a lane that something lies on."""

from bus_sim.systems.terminal.plant import TerminalPlant
from bus_sim.systems.terminal.run import TerminalRun
from bus_sim.web.run_source import Arguments, RunSource
from onboard.systems.terminal.site import Blockage, EntityKind
from onboard.web.app import CommandError


class TerminalSource(RunSource):
    """A terminal's run in this process."""

    def __init__(self, run: TerminalRun) -> None:
        super().__init__(run, acts={"block": self._block, "clear": self._free})
        self._plant: TerminalPlant = run.plant

    def _lane(self, arguments: Arguments) -> int:
        site = self._plant.site
        entity = site.by_name.get(str(arguments.get("place")))
        if entity is None or entity.kind is not EntityKind.LANE:
            names = ", ".join(one.name for one in site.entities.values() if one.kind is EntityKind.LANE)
            raise CommandError(f"{arguments.get('place')}: no lane of this site; there are {names}")
        return entity.number

    def _block(self, arguments: Arguments) -> str:
        lane = self._lane(arguments)
        self._plant.block(Blockage(lane, self._plant.now_us(), 0))
        return f"something lies on {self._plant.site.entities[lane].name}"

    def _free(self, arguments: Arguments) -> str:
        lane = self._lane(arguments)
        self._plant.free(lane)
        return f"{self._plant.site.entities[lane].name} is free again"
