"""A turning cell in the simulator."""

from bus_sim.systems.orders import OrderArrivals, OrderedSystem
from bus_sim.systems.turning.orders import ORDER_S, draw, last_s
from bus_sim.systems.turning.plant import make_plant
from bus_sim.systems.turning.stage import TurningStage
from onboard.contract.codes import KindCode
from onboard.systems.turning.site import Turning

SIMULATED = OrderedSystem(
    Turning.system,
    make_plant,
    TurningStage,
    draw,
    last_s,
    lambda _: ORDER_S,
    lambda _: OrderArrivals(4, 120.0),
    worker=KindCode.LATHE,
)
