"""Puts faults to work: frame faults into the bus when it is built, everything else by timers once it runs."""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Final

from bus_sim.attacks.launch import attack
from bus_sim.can.faults import Fault
from bus_sim.faults import bus, controllers, devices, operators
from bus_sim.faults.holon import FaultyHolon
from bus_sim.faults.injection import AnyFault, Injection
from bus_sim.faults.table import KINDS
from bus_sim.systems.car_park import people
from bus_sim.systems.car_park.simulation import Simulation
from onboard.config.problems import nearest
from onboard.core.site import Site

#: What each kind does at its time; kinds that are frame faults have nothing here.
ACTIONS: Final[dict[str, Callable[[Simulation, Injection], None]]] = {
    "overflow": controllers.overflow,
    "babble": bus.babble,
    "double_id": bus.double_id,
    "attack": attack,
    "crash": controllers.crash,
    "pause": controllers.pause,
    "slow_node": controllers.slow_node,
    "disk_full": controllers.disk_full,
    "power_cut": controllers.power_cut,
    "drift": controllers.drift,
    "clock_frozen": controllers.clock_frozen,
    "clock_jump": controllers.clock_jump,
    "sensor_off": devices.sensor_off,
    "sensor_stuck": devices.sensor_stuck,
    "sensor_flaky": devices.sensor_flaky,
    "sensor_wrong": devices.sensor_wrong,
    "actuator_stuck": devices.actuator_stuck,
    "actuator_slow": devices.actuator_slow,
    "actuator_halfway": devices.actuator_halfway,
    "lost_ticket": people.lost_ticket,
    "key_presses": people.key_presses,
    "cancel": people.cancel,
    "linger": people.linger,
    "oversize": people.oversize,
    "door_forced": people.door_forced,
    "moved": people.moved,
    "blocked": operators.blocked,
    "emergency_stop": operators.emergency_stop,
    "operate": operators.operate,
}
#: What is there from power-up on and waits for its time by itself.
_FROM_POWER_UP: Final = frozenset({"attack"})


def check_targets(faults: Iterable[AnyFault], site: Site) -> None:
    """Raise ``ValueError`` with one clear line for a machine that the site does not have."""
    known = [machine.name for machine in site.machines.values()]
    for fault in faults:
        if not isinstance(fault, Injection):
            continue
        for key in ("target", "members", "receivers"):
            if key in KINDS[fault.kind].settings:
                for name in fault.text(key).split("|"):
                    # A machine that need not be named is the empty word.
                    if name and name not in known:
                        raise ValueError(
                            f"fault {str(fault)!r}: {key}={name}: no such machine on site {site.name}; "
                            f"{nearest(name, known)}"
                        )


def frame_faults(faults: Iterable[AnyFault], site: Site) -> tuple[Fault, ...]:
    """Those faults that act on single frames of the fleet bus, for ``RunOptions.faults``."""
    found: list[Fault] = []
    for fault in faults:
        found += [fault] if isinstance(fault, Fault) else bus.frame_faults(fault, site)
    return tuple(found)


def arm(
    simulation: Simulation,
    faults: Iterable[AnyFault],
    actions: Mapping[str, Callable[[Simulation, Injection], None]] = ACTIONS,
) -> None:
    """Set up all others; before ``Simulation.start``, with the customers on the street."""
    injections = [fault for fault in faults if isinstance(fault, Injection)]
    if not injections:
        return
    simulation.holon_class = FaultyHolon
    for medium in simulation.devices.values():
        # A device bus has several nodes, so that a frame is acknowledged though the controller is off.
        medium.attach("terminal block", None)
    for injection in injections:
        action = actions.get(injection.kind)
        if action is None:
            continue
        if "at_s" in KINDS[injection.kind].settings and injection.kind not in _FROM_POWER_UP:
            simulation.plant.timers.call_at(injection.at_us, partial(action, simulation, injection))
        else:
            action(simulation, injection)
