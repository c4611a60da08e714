"""The kit before a robot in virtual time: the player that a bus has as well, its frames on the simulated one."""

import asyncio
from collections.abc import Callable, Iterable
from pathlib import Path

from bus_sim.options import RunOptions
from bus_sim.systems.car_park.plant.bodies import CarBody
from bus_sim.systems.car_park.plant.motion import driving, standing
from bus_sim.systems.car_park.simulation import Simulation, build
from bus_sim.virtual_time import VirtualTimeLoop
from onboard.config.site import load_site
from onboard.conform.player import Player, Scene
from onboard.conform.stage import Means, PlatformRun
from onboard.conform.suite import scenes_of, watchers_of
from onboard.contract.codes import DoorName, DoorPosition
from onboard.core.frame import Frame
from onboard.ports.bus import Bus
from onboard.systems.car_park.site import CarPark, car_park
from onboard.ways.lifts import stop_mm
from onboard.wire.codec import fleet_codec

#: The robot alone, then with another, then the other way round.
SITES = tuple(
    car_park(load_site(Path(__file__).parent / f"{name}.toml")) for name in ("bench", "pair", "mirror", "lift")
)
SITE = SITES[0]
WHEELBASE_MM = 2_870
#: No play is longer, s of virtual time.
LIMIT_S = 3_600.0
#: What a bench with a switch and a car has.
ALL = Means(power=True, has_car=True, wheelbase_mm=WHEELBASE_MM)
#: Switches a node on and off.
Switch = Callable[[bool], None]


class VirtualBench:
    """Carries a player's frames and wakes; ``switch`` is given what it says of power."""

    def __init__(self, player: Player, simulation: Simulation, switch: Switch) -> None:
        self.player, self.loop, self.switch = player, simulation.loop, switch
        self.world = simulation.plant.world
        self.bus: Bus = simulation.fleet.attach("kit", None)
        self.bus.subscribe(self.on_frame)
        self.over = asyncio.Event()
        self.due_us = -1
        player.start(self.loop.now_us())
        self.carry_out()

    def move(self, ride: PlatformRun) -> None:
        """The platform as it is goes where the kit's lift has it go."""
        world, now_us = self.world, self.loop.now_us()
        track, axis = world.platforms[ride.node].track, world.site.lift
        from_mm, to_mm = world.platforms[ride.node].motion.final_mm, float(stop_mm(world.site, track, ride.stop))
        motion = driving(from_mm, 0.0, to_mm, axis.speed_mm_s, axis.acceleration_mm_s2, now_us)
        world.move_platform(ride.node, motion)
        self.loop.at_us(motion.end_us, lambda now: world.move_platform(ride.node, standing(to_mm, now)))

    def on_frame(self, frame: Frame, time_us: int) -> None:
        self.player.receive(frame, time_us)
        self.carry_out()

    def on_time(self, when_us: int) -> None:
        if when_us == self.due_us:
            self.due_us = -1
            self.player.wake(when_us)
            self.carry_out()

    def carry_out(self) -> None:
        self.player.hand_out(self.bus.send, self.switch, self.move)
        if self.player.is_over:
            self.over.set()
            return
        due_us = self.player.next_us()
        if self.due_us < 0 or due_us < self.due_us:
            self.due_us = max(due_us, self.loop.now_us() + 1)
            self.loop.at_us(self.due_us, self.on_time)


def ours(simulation: Simulation) -> Switch:
    """Our own robot."""
    machine = simulation.site.machine("MR1")

    def switch(on: bool) -> None:
        if on:
            simulation.start_controller(machine)
        else:
            simulation.crash(machine)

    return switch


def play(
    scenes: Iterable[str] = (),
    *,
    site: CarPark = SITE,
    means: Means = ALL,
    joins: Callable[[Simulation], Switch] = ours,
    stops_at_first: bool = False,
) -> Player:
    """The whole play, or these scenes of it behind the first; the player when it is over."""
    names, every = set(scenes), scenes_of(site)
    wanted: list[Scene] = [one for one in every if not names or one.name in names or one is every[0]]
    loop = VirtualTimeLoop()
    try:
        return loop.run_until_complete(_play(wanted, site, means, joins, loop, stops_at_first))
    finally:
        loop.close()


async def _play(
    scenes: list[Scene],
    site: CarPark,
    means: Means,
    joins: Callable[[Simulation], Switch],
    loop: VirtualTimeLoop,
    stops_at_first: bool,
) -> Player:
    nobody = frozenset(one.name for one in site.machines.values())
    simulation = build(site, RunOptions(seed=1, without=nobody), loop)
    bay = min(site.compartments)
    simulation.plant.world.car_enters(bay, CarBody("car", WHEELBASE_MM, 4_500, 1_500, 1_400))
    simulation.plant.world.set_door(bay, DoorName.OUTPUT, DoorPosition.OPEN)
    simulation.start()
    switch = joins(simulation)
    node = site.machine("MR1").node_id
    player = Player(site, node, fleet_codec(), scenes, means, watchers_of(site), stops_at_first=stops_at_first)
    if not means.power:
        switch(True)
    bench = VirtualBench(player, simulation, switch)
    await asyncio.wait_for(bench.over.wait(), LIMIT_S)
    return player
