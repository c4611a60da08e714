"""Puts faults to work: frame faults into the bus when it is built, everything else by timers once it runs."""

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any, Final

from bus_sim.attacks.launch import attack
from bus_sim.demand import DemandError
from bus_sim.faults import bus, controllers, devices, operators, slowness
from bus_sim.faults.bus import FRAME_FAULTS
from bus_sim.faults.holon import FaultyHolon
from bus_sim.faults.injection import AnyFault, Injection
from bus_sim.faults.table import KINDS
from bus_sim.run import BusRun
from bus_sim.systems.registry import simulated_of
from bus_sim.systems.system import Action
from onboard.config.problems import nearest
from onboard.core.site import Site
from onboard.operate.names import OperateError, movable_of

#: What each kind that any system can have does at its time; kinds that are frame faults have nothing here.
ACTIONS: Final[dict[str, Action]] = {
    "overflow": controllers.overflow,
    "babble": bus.babble,
    "double_id": bus.double_id,
    "attack": attack,
    "crash": controllers.crash,
    "pause": controllers.pause,
    "slow": slowness.slow,
    "slow_node": controllers.slow_node,
    "disk_full": controllers.disk_full,
    "power_cut": controllers.power_cut,
    "drift": controllers.drift,
    "clock_frozen": controllers.clock_frozen,
    "clock_jump": controllers.clock_jump,
    "sensor_off": devices.sensor_off,
    "sensor_flaky": devices.sensor_flaky,
    "actuator_stuck": devices.actuator_stuck,
    "emergency_stop": operators.emergency_stop,
    "held": operators.held,
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
        if fault.kind == "held":
            try:
                movable_of(site, fault.target)
            except OperateError as error:
                raise ValueError(f"fault {str(fault)!r}: {error}") from error


def actions_for(site: Site) -> Mapping[str, Action]:
    """All that can happen on a site at a chosen time, by kind: what happens anywhere, and its system's own."""
    return {**ACTIONS, **simulated_of(site).actions}


def check_faults(faults: Iterable[AnyFault], site: Site) -> None:
    """Raise ``DemandError`` for a kind of fault that strikes nothing on this site, and for a machine it has not."""
    known = (*FRAME_FAULTS, *actions_for(site))
    for fault in faults:
        if isinstance(fault, Injection) and fault.kind not in known:
            what = f"a {site.called} has nothing that this strikes ({KINDS[fault.kind].summary})"
            raise DemandError(f"--fault {fault}: {site.name}: {what}; use {', '.join(sorted(known))}")
    try:
        check_targets(faults, site)
    except ValueError as error:
        raise DemandError(f"--fault: {error}") from error


def arm(run: BusRun[Any], faults: Iterable[AnyFault], actions: Mapping[str, Action] | None = None) -> None:
    """Set up all faults but those of single frames; before ``BusRun.start``. ``actions``: None for the site's own."""
    injections = [fault for fault in faults if isinstance(fault, Injection)]
    if not injections:
        return
    acts = actions_for(run.site) if actions is None else actions
    run.holon_class = FaultyHolon
    for medium in run.devices.values():
        # A device bus has several nodes, so that a frame is acknowledged though the controller is off.
        medium.attach("terminal block", None)
    for injection in injections:
        action = acts.get(injection.kind)
        if action is None:
            continue
        if "at_s" in KINDS[injection.kind].settings and injection.kind not in _FROM_POWER_UP:
            run.plant.timers.call_at(injection.at_us, partial(action, run, injection))
        else:
            action(run, injection)
