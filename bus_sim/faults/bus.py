"""Faults of the fleet bus: those that are frame faults in a window, and nodes that do not belong there."""

from collections.abc import Iterable
from functools import partial
from typing import Any

from bus_sim.can.faults import FaultKind, InjectedFault
from bus_sim.can.node import SimulatedBus
from bus_sim.faults.injection import AnyFault, Injection
from bus_sim.journal import SimulatedJournal
from bus_sim.run import BusRun, NoWatchdog
from onboard.controller.shell import Controller, Ports
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.holon.holon import Holon
from onboard.ports.bus import BusHealth, ErrorState, FrameHandler

#: The lowest byte of an identifier is the sender's node-ID.
SENDER_MASK = 0xFF


def frame_faults(faults: Iterable[AnyFault], site: Site) -> tuple[InjectedFault, ...]:
    """Those faults that act on single frames of the fleet bus, and what others come down to."""
    found: list[InjectedFault] = []
    for fault in faults:
        found += [fault] if isinstance(fault, InjectedFault) else _as_frame_faults(fault, site)
    return tuple(found)


def _as_frame_faults(injection: Injection, site: Site) -> list[InjectedFault]:
    """The faults of single frames that an injection comes down to; none where it is another thing."""
    make = _AS_FRAME_FAULTS.get(injection.kind)
    if make is None or injection.until_us <= injection.at_us:
        return []
    return make(injection, site)


def _burst(injection: Injection, _: Site) -> list[InjectedFault]:
    return [
        InjectedFault(FaultKind.CORRUPTION, from_us=injection.at_us, until_us=injection.until_us, seed=_seed(injection))
    ]


def _bit_errors(injection: Injection, _: Site) -> list[InjectedFault]:
    return [
        InjectedFault(
            FaultKind.CORRUPTION,
            probability=injection.number("probability"),
            from_us=injection.at_us,
            until_us=injection.until_us,
            seed=_seed(injection),
        )
    ]


def _lossy(injection: Injection, _: Site) -> list[InjectedFault]:
    return [
        InjectedFault(
            FaultKind.OMISSION,
            receivers=tuple(injection.text("receivers").split("|")),
            probability=injection.number("probability"),
            from_us=injection.at_us,
            until_us=injection.until_us,
            seed=_seed(injection),
        )
    ]


def _reorder(injection: Injection, _: Site) -> list[InjectedFault]:
    return [
        InjectedFault(
            FaultKind.DELAY,
            receivers=tuple(injection.text("receivers").split("|")),
            probability=injection.number("probability"),
            delay_us=injection.count("delay_ms") * 1000,
            from_us=injection.at_us,
            until_us=injection.until_us,
            seed=_seed(injection),
        )
    ]


def _bus_off(injection: Injection, site: Site) -> list[InjectedFault]:
    """Every frame of this sender is destroyed: eight more on TEC each time, off the bus above 255 (ISO 11898-1)."""
    node = _node(site, injection.target)
    return [
        InjectedFault(
            FaultKind.CORRUPTION,
            id_value=node,
            id_mask=SENDER_MASK,
            extended=True,
            from_us=injection.at_us,
            until_us=injection.until_us,
            seed=_seed(injection),
        )
    ]


def _partition(injection: Injection, site: Site) -> list[InjectedFault]:
    """What one side sends the other does not hear; a fault for each sender, as senders are in the identifier."""
    inside = injection.text("members").split("|")
    outside = [machine.name for machine in site.machines.values() if machine.name not in inside]
    way = injection.text("way")
    ways = ([(inside, outside)] if way != "in" else []) + ([(outside, inside)] if way != "out" else [])
    return [
        InjectedFault(
            FaultKind.OMISSION,
            receivers=tuple(deaf),
            id_value=_node(site, sender),
            id_mask=SENDER_MASK,
            extended=True,
            from_us=injection.at_us,
            until_us=injection.until_us,
        )
        for senders, deaf in ways
        if deaf
        for sender in senders
    ]


_AS_FRAME_FAULTS = {
    "burst": _burst,
    "bit_errors": _bit_errors,
    "lossy": _lossy,
    "reorder": _reorder,
    "bus_off": _bus_off,
    "partition": _partition,
}


#: Kinds that come down to faults of single frames.
FRAME_FAULTS = tuple(_AS_FRAME_FAULTS)


def _seed(injection: Injection) -> int:
    return injection.count("seed")


def _node(site: Site, name: str) -> int:
    return next(machine.node_id for machine in site.machines.values() if machine.name == name)


# --- nodes that do not belong there ----------------------------------------------------------------------------


def babble(simulation: BusRun[Any], injection: Injection) -> None:
    """A node that says one frame of high priority over and over until its time is over."""
    bus = simulation.fleet.attach(f"babbler {injection.at_us}", None)
    frame = Frame(injection.count("id"), b"\x55" * 8)
    _babble_on(simulation, bus, frame, 1_000_000 // injection.count("rate_hz"), injection.until_us)


def _babble_on(simulation: BusRun[Any], bus: SimulatedBus, frame: Frame, gap_us: int, until_us: int) -> None:
    now_us = simulation.loop.now_us()
    if now_us >= until_us:
        bus.power_off()
        return
    if bus.waiting_to_send < 2:
        bus.send(frame)
    again = partial(_babble_on, simulation, bus, frame, gap_us, until_us)
    simulation.plant.timers.call_at(now_us + max(1, gap_us), again)


class NoDevices:
    """A device bus on which nobody is: it says nothing and takes everything."""

    name = "nothing"

    def subscribe(self, on_frame: FrameHandler, on_sent: FrameHandler | None = None) -> None:
        """No handler is ever called: nobody else is on this bus."""

    def send(self, frame: Frame) -> bool:
        """Taken, and heard by nobody."""
        return True

    def health(self) -> BusHealth:
        """Nothing was ever sent or received."""
        return BusHealth(ErrorState.ERROR_ACTIVE, 0, 0, 0, 0, 0, 0)

    async def close(self) -> None:
        """Nothing was opened, so there is nothing to give back."""


def double_id(simulation: BusRun[Any], injection: Injection) -> None:
    """A second board with the same machine file, a journal of its own that is empty, and no devices behind it."""
    machine = next(one for one in simulation.site.machines.values() if one.name == injection.target)
    holon = Holon(simulation.site, machine, simulation.factories(simulation.site, machine.kind))
    fleet = simulation.fleet.attach(f"{machine.name} again {injection.at_us}", machine.node_id)
    ports = Ports(fleet, NoDevices(), SimulatedJournal(), simulation.log, NoWatchdog())
    controller = Controller(holon, ports, simulation.codecs.fleet, simulation.codecs.device)
    controller.start()
    simulation.plant.timers.call_at(injection.until_us, partial(_unplug, controller, fleet))


def _unplug(controller: Controller, fleet: SimulatedBus) -> None:
    controller.holon.halted = controller.holon.halted or "unplugged"
    fleet.power_off()
