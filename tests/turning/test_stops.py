"""A control goes on only while its machine lets it: an emergency stop holds the tool too (dbc/turning.dbc, LatheOrder)."""

from typing import Any

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.options import RunOptions
from bus_sim.run import BusRun
from bus_sim.session import play
from bus_sim.sites import find_site
from bus_sim.systems.stage import SystemStage
from onboard.contract.turning import NcMode
from onboard.contract.turning_device import NcState

LATHES = (1, 2, 3)


def played(*faults: str, limit_s: float) -> tuple[SystemStage[Any], dict[int, list[tuple[float, NcMode]]]]:
    """A run of the shipped site, and what each control said that it does, with times, s."""
    modes: dict[int, list[tuple[float, NcMode]]] = {node: [] for node in LATHES}

    def before(run: BusRun[Any]) -> None:
        arm(run, [parse_injection(one) for one in faults])
        for node in LATHES:

            def hear(message: object, _: int, node: int = node) -> None:
                if isinstance(message, NcState):
                    modes[node].append((run.loop.now_us() / 1e6, message.nc_mode))

            run.controllers_listen(node, hear)

    return play(find_site("turning"), RunOptions(limit_s=limit_s), prepare=before), modes
