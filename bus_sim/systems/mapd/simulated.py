"""Pick-up and delivery in the simulator."""

from bus_sim.systems.mapd.orders import draw, last_s, order_s, usual
from bus_sim.systems.mapd.plant import make_plant
from bus_sim.systems.mapd.stage import MapdStage
from bus_sim.systems.orders import OrderedSystem
from onboard.systems.mapd.site import Mapd

SIMULATED = OrderedSystem(Mapd.system, make_plant, MapdStage, draw, last_s, order_s, usual)
