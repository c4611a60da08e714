"""A terminal in the simulator."""

from bus_sim.systems.orders import OrderArrivals, OrderedSystem
from bus_sim.systems.terminal.forged import ForgedTransports
from bus_sim.systems.terminal.orders import ORDER_S, draw, last_s
from bus_sim.systems.terminal.plant import make_plant
from bus_sim.systems.terminal.run import TerminalRun
from bus_sim.systems.terminal.stage import TerminalStage
from onboard.contract.codes import KindCode
from onboard.systems.terminal.site import Terminal

#: Where a person looks on: so many simulated seconds a second, unless another speed was asked for.
LOOK_SPEED = 20.0

SIMULATED = OrderedSystem(
    Terminal.system,
    make_plant,
    TerminalStage,
    draw,
    last_s,
    lambda _: ORDER_S,
    lambda _: OrderArrivals(5, 30.0),
    worker=KindCode.VEHICLE,
    connected=TerminalRun,
    look_speed=LOOK_SPEED,
    attacks={"orders": ForgedTransports},
)
