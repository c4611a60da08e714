"""An idle machine that stands in the way of another's task gives way (row P38; design, section 5)."""

from bus_sim.systems.car_park.simulation import Simulation
from onboard.config.site import parse_site
from onboard.contract.codes import Grade, LegAction, TaskPhase
from onboard.contract.messages import CallForProposals, Itinerary, TaskReport
from onboard.core.negotiation import Estimator
from onboard.core.site import Site
from tests.system.scene import Scene, play, stays

#: Three floors of six positions and one lift; the only places are behind the robot that stands at p(2,3).
TOWER = """
[site]
name = "tower"
[floors]
count = 3
positions = 6
sides = ["near"]
without = [{without}]
[[compartments]]
name = "IOC1"
node = 1
at = "p(1,3)"
[[lifts]]
name = "ER1"
node = 5
end = "left"
[[robots]]
name = "MR1"
node = 11
home = "p(2,3)"
[[robots]]
name = "MR2"
node = 12
home = "p(3,3)"
"""
IDLE, BUSY = 11, 12


def tower() -> Site:
    """Without the places of the street, of the third floor, and before p(2,5)."""
    others = [f"p({floor},{index})N" for floor in (1, 3) for index in range(1, 7) if (floor, index) != (1, 3)]
    others += [f"p(2,{index})N" for index in range(1, 5)]
    names = ", ".join(f'"{place}"' for place in others)
    return parse_site(TOWER.format(without=names), "tower.toml", crowded=True)


def only_one_bids(simulation: Simulation) -> None:
    """The robot in the way takes no tasks: another would be served by itself, as it stands nearer."""
    estimator: Estimator = simulation.controllers[IDLE].holon.negotiation.estimator

    def unable(call: CallForProposals, now_us: int) -> int | None:
        return None

    estimator.lower_bound = unable  # type: ignore[method-assign]  # a machine that can do nothing, for this scene


def firm(scene: Scene, node: int) -> list[tuple[int, Itinerary]]:
    return [(at, m) for at, m in scene.all(Itinerary, "fleet") if m.sender == node and m.grade is Grade.FIRM]


def test_p38_an_idle_machine_gives_way_and_the_task_goes_on() -> None:
    scene = play(tower(), stays((0, None)), before=only_one_bids, extra_s=200)
    scene.assert_sound()
    done = [m for _, m in scene.all(TaskReport, "fleet") if m.phase is TaskPhase.DONE]
    assert [m.sender for m in done] == [BUSY]
    told_us = next(at for at, plan in firm(scene, BUSY) if any(leg.action is LegAction.WORK for leg in plan.legs))
    evades = next((at, plan) for at, plan in firm(scene, IDLE) if at > told_us)
    assert evades[0] - told_us < 100_000
    # Deeper into its own alley: the other floor above the street belongs to the one who comes.
    assert evades[1].legs[-1].track == 2 and evades[1].legs[-1].to_index > 3
