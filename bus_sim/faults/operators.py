"""What a person does at an operator's station: a node of its own on the fleet bus, above all machines."""

from functools import partial

from bus_sim.faults.injection import Injection
from bus_sim.run import Simulation
from onboard.core.codes import Reason
from onboard.core.messages import Blocked, Clear, EmergencyStop, Message
from onboard.core.site import Segment
from onboard.wire.codec import fleet_codec

#: The station's node-ID: 251 to 255 are kept for gateways and tools (dbc/fleet.dbc).
STATION = 251


def blocked(simulation: Simulation, injection: Injection) -> None:
    """Somebody says that a segment cannot be passed, and some time later that it can."""
    where = Segment(injection.count("track"), injection.count("index"))
    _say(simulation, Blocked(STATION, *where, Reason.OPERATOR))
    if injection.number("for_s"):
        clear = partial(_say, simulation, Clear(STATION, *where, Reason.OPERATOR))
        simulation.plant.timers.call_at(injection.until_us, clear)


def emergency_stop(simulation: Simulation, _: Injection) -> None:
    """Somebody presses the button: every machine stops until it is switched on again."""
    _say(simulation, EmergencyStop(STATION, Reason.OPERATOR))


def _say(simulation: Simulation, message: Message) -> None:
    bus = simulation.fleet.attach(f"operator {simulation.loop.now_us()}", STATION)
    for frame in fleet_codec().encode(message):
        bus.send(frame)
