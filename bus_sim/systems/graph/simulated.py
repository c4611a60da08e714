"""A factory graph in the simulator."""

from bus_sim.systems.graph.forged import ForgedGoAheads, ForgedVisits
from bus_sim.systems.graph.orders import ORDER_S, draw, last_s, usual
from bus_sim.systems.graph.plant import make_plant
from bus_sim.systems.graph.stage import GraphStage
from bus_sim.systems.orders import OrderedSystem
from onboard.contract.codes import KindCode
from onboard.systems.graph.site import FactoryGraph

SIMULATED = OrderedSystem(
    FactoryGraph.system,
    make_plant,
    GraphStage,
    draw,
    last_s,
    lambda _: ORDER_S,
    usual,
    worker=KindCode.VEHICLE,
    attacks={"orders": ForgedVisits, "answers": ForgedGoAheads},
)
