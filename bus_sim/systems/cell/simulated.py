"""A cell of arms in the simulator."""

from bus_sim.systems.cell.orders import ORDER_S, draw, last_s
from bus_sim.systems.cell.plant import make_plant
from bus_sim.systems.cell.stage import CellStage
from bus_sim.systems.orders import OrderArrivals, OrderedSystem
from onboard.contract.codes import KindCode
from onboard.systems.cell.site import Cell

SIMULATED = OrderedSystem(
    Cell.system,
    make_plant,
    CellStage,
    draw,
    last_s,
    lambda _: ORDER_S,
    lambda _: OrderArrivals(6, 20.0),
    worker=KindCode.ARM,
)
