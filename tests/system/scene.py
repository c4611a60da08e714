"""A whole site in virtual time for one test, with everything said on any of its buses written down."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

from bus_sim.can.error_frames import ErrorsHeard
from bus_sim.can.faults import InjectedFault
from bus_sim.options import RunOptions
from bus_sim.run import FLEET, run_until
from bus_sim.systems.car_park.demand import Demand, Stay
from bus_sim.systems.car_park.plant.bodies import CarBody
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.contract.messages import Message
from onboard.contract.runs import singles
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.systems.contract import codecs_for
from onboard.trace.check.checks import Checks, LogVerdict
from onboard.wire.codec import Codec
from onboard.wire.decoder import Decoder

M = TypeVar("M", bound=Message)

#: Customers come this long after power-up.
ORIGIN_US = 10_000_000


@dataclass(frozen=True)
class Said:
    """One message on one bus (``fleet`` or a machine's name) at the end of its last frame."""

    time_us: int
    bus: str
    message: Message


@dataclass
class Scene:
    """A finished run."""

    simulation: Simulation
    said: list[Said] = field(default_factory=list)

    def all(self, kind: type[M], bus: str | None = None) -> list[tuple[int, M]]:
        """All messages of a class with their times, of one bus or of all."""
        return [(s.time_us, s.message) for s in self.said if isinstance(s.message, kind) and bus in (None, s.bus)]

    def first(self, kind: type[M], where: Callable[[M], bool] = lambda _: True, after_us: int = 0) -> tuple[int, M]:
        """The first message of a class that fits; fails the test where there is none."""
        for time_us, message in self.all(kind):
            if time_us >= after_us and where(message):
                return time_us, message
        raise AssertionError(f"no {kind.__name__} as expected after {after_us / 1e6:.3f} s")

    def assert_sound(self) -> None:
        """Nothing broke in the plant, no controller halted, and no checker of what was said finds anything."""
        assert self.simulation.plant.oracle.finish() == []
        verdict = self.verdict()
        assert verdict.is_good, "\n" + "\n".join(verdict.lines())
        assert {
            c.holon.machine.name: c.holon.halted for c in self.simulation.controllers.values() if c.holon.halted
        } == {}

    def verdict(self) -> LogVerdict:
        """What the checkers say, which see only what was on the buses; frames that faults took away count as such."""
        checks = Checks(self.simulation.site, disturbed=bool(self.simulation.options.faults))
        for said in self.said:
            checks.feed_message(said.time_us, said.message, said.bus)
        return checks.finish()


def car(number: int, *, wheelbase_mm: int = 2700, length_mm: int = 4300, height_mm: int = 1500) -> CarBody:
    """One car."""
    return CarBody(f"car {number}", wheelbase_mm, length_mm, height_mm, 1400)


def stays(*times_s: tuple[float, float | None]) -> Demand:
    """Cars that come and go at these seconds after the customers' time zero."""
    return Demand(
        tuple(
            Stay(round(come * 1e6), None if go is None else round(go * 1e6), car(number))
            for number, (come, go) in enumerate(times_s, start=1)
        )
    )


def play(
    site: Site,
    demand: Demand,
    *,
    seed: int = 1,
    limit_s: float = 3_600,
    faults: Sequence[InjectedFault] = (),
    before: Callable[[Simulation], None] | None = None,
    extra_s: float = 60,
    plant: Callable[[Simulation], None] | None = None,
    without: frozenset[str] = frozenset(),
    after: Callable[[], Awaitable[None]] | None = None,
) -> Scene:
    """Run a site until all customers are served (or the limit), then a little longer.

    ``plant`` is called before power-up, ``before`` right after it, ``after`` at the end, on the loop still. Machines
    named in ``without`` are not started.
    """
    loop = VirtualTimeLoop()
    options = RunOptions(seed=seed, faults=tuple(faults), without=without)
    try:
        scene = loop.run_until_complete(_play(site, demand, options, limit_s, before, loop, extra_s, plant))
        if after is not None:
            loop.run_until_complete(_finish(after))
        return scene
    finally:
        loop.close()


async def _finish(after: Callable[[], Awaitable[None]]) -> None:
    await after()


async def _play(
    site: Site,
    demand: Demand,
    options: RunOptions,
    limit_s: float,
    before: Callable[[Simulation], None] | None,
    loop: VirtualTimeLoop,
    extra_s: float,
    plant: Callable[[Simulation], None] | None,
) -> Scene:
    simulation = build(site, options, loop)
    scene = Scene(simulation)
    codecs = codecs_for(site)
    _listen(scene, FLEET, codecs.fleet)
    for node_id, machine in site.machines.items():
        _listen(scene, machine.name, codecs.device, node_id)
    simulation.plant.street.add_all(demand, ORIGIN_US)
    if plant is not None:
        plant(simulation)
    simulation.start()
    if before is not None:
        before(simulation)
    limit_us = round(limit_s * 1e6)
    await run_until(simulation, lambda: simulation.plant.street.is_over, limit_us, 1_000_000)
    await asyncio.sleep(extra_s)
    return scene


def _listen(scene: Scene, name: str, codec: Codec, node_id: int | None = None) -> None:
    decoder = Decoder(codec)
    medium = scene.simulation.fleet if node_id is None else scene.simulation.devices[node_id]

    def on_frame(frame: Frame, time_us: int, _: str) -> None:
        message = decoder.feed(frame, time_us)
        for word in singles(message) if message is not None else ():
            scene.said.append(Said(time_us, name, word))

    medium.tap(on_frame, errors=ErrorsHeard.NONE)
