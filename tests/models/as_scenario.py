"""A counterexample of an exploration as a scenario that ``bus-sim run --scenario`` plays: the crash at the same effect.

What was explored happens somewhere in a run of the same machines on `level1`: a car is parked and fetched. The power
fails there at the same line of the journal, before or behind it. That frames are late or lost is not told: a run says
words in their order, and most counterexamples do with those that the crash itself leaves unsaid.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from bus_sim.campaign.trial import stage_of
from bus_sim.faults.injection import Injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.run import run_until
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Arrivals
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from tests.models.engine import Engine, State
from tests.models.gate import LIFT

#: One car, parked and fetched: who it is by the nodes of `tests.sites.one_floor`, as here.
SCENE = FaultScenario("level1", 1, 1_200.0, Arrivals(1, 60.0, 20.0, 100.0))
#: The same where a lift is needed, by its nodes and those of `tests.models.gate`.
LIFT_SCENE = replace(SCENE, site="small")
#: The power is back before anybody takes the machine for lost, s: so it is where no while passes.
RESTART_S = 1.0
#: By these lines of one kind are told apart.
_TELLING = ("record", "operation", "kind", "handling", "phase")


def as_scenario(engine: Engine, state: State) -> FaultScenario:
    """The crashes on the way to a state. Raises ``ValueError`` where one of them is not at a line of a journal."""
    scene = LIFT_SCENE if LIFT in engine.nodes else SCENE
    return scene.with_faults(
        _crash(scene, node, line, durable=durable) for node, line, durable in _crashes(engine, state)
    )


def _crashes(engine: Engine, state: State) -> list[tuple[int, dict[str, Any], bool]]:
    """The crashes on the way to a state: of which node, at which line of its journal, and whether that was written.

    The line is the next of what it was doing, else the last that it had written.
    """
    found = []
    for before, (what, i, about, most) in engine.way(state):
        if what != "crashes" and most < 0:
            continue
        doing = engine.doing(before, i, about) if most >= 0 else ()
        following = [deed for deed in doing[max(most, 0) :] if isinstance(deed, tuple)]
        written = [*engine.journal(before, i), *doing[: max(most, 0)]]
        lines = following[:1] or [deed for deed in written if isinstance(deed, tuple)][-1:]
        found.append((engine.nodes[i], dict(lines[0]), not following))
    return found


def _crash(scene: FaultScenario, node: int, line: Mapping[str, Any], *, durable: bool) -> Injection:
    site = find_site(scene.site)
    told = {key: line[key] for key in _TELLING if key in line}
    written = _written(scene, node)
    alike = [number for number, entry in enumerate(written, start=1) if told.items() <= entry.items()]
    if not alike:
        raise ValueError(f"the scene's node {node} writes no line with {told}")
    settings = {"write": alike[-1], "durable": "yes" if durable else "no", "restart_s": RESTART_S}
    return Injection("crash", {"target": site.machines[node].name, "at_s": 0, **settings})


def _written(scene: FaultScenario, node: int) -> list[Mapping[str, Any]]:
    """What a machine writes in the scene without any fault."""
    loop = VirtualTimeLoop()
    stage = stage_of(find_site(scene.site), scene, loop)

    async def play() -> None:
        stage.run.start()
        await run_until(stage.run, lambda: stage.is_over, round(scene.limit_s * 1e6), 1_000_000)
        stage.run.close()

    run_on(loop, play())
    return list(stage.run.journals[node].entries)
