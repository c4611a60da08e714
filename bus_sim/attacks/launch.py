"""Puts an attack to work on a run that is under way, as the fault ``attack`` (bus_sim/faults/table.py)."""

import random
from typing import Any

from bus_sim.attacks.attack import TICK_US, Attack, AttackerNode
from bus_sim.attacks.catalogue import ATTACKS
from bus_sim.attacks.stolen import StolenKeys
from bus_sim.can.node import SimulatedBus
from bus_sim.faults.injection import Injection
from bus_sim.run import BusRun
from bus_sim.systems.registry import simulated_of
from onboard.contract.messages import Message
from onboard.contract.runs import singles
from onboard.core.frame import Frame
from onboard.wire.decoder import Decoder


def attack(run: BusRun[Any], injection: Injection) -> None:
    """Join the bus at power-up as a listener, begin when it is time, and leave when it is over."""
    _Attacker(run, injection)


class _Attacker:
    """The attacker's node on the bus and its timers."""

    def __init__(self, run: BusRun[Any], injection: Injection) -> None:
        self._run, self._injection = run, injection
        node_id = injection.count("node")
        name = f"attacker {injection.text('name')} {injection.at_us}"
        self._bus: SimulatedBus = run.fleet.attach(name, node_id)
        self._decoder = Decoder(run.codecs.fleet)
        chance = random.Random(f"attack:{run.site.name}:{injection}")
        node = AttackerNode(run.site, node_id, chance, self._say, self._put, lambda: self._bus.waiting_to_send)
        self._is_begun = False
        has_keys = injection.text("keys") == "stolen" and run.seals.are_used
        self._keys = StolenKeys(run.seals, node_id, run.codecs.fleet.decode_part) if has_keys else None
        what = injection.text("name")
        own = simulated_of(run.site).attacks.get(what)
        self._attack: Attack = (own or ATTACKS[what].attack)(node)
        self._bus.subscribe(self._hear)
        run.plant.timers.call_at(injection.at_us, self._begin)

    def _say(self, message: Message) -> None:
        for frame in self._run.codecs.fleet.encode(message):
            self._put(frame)

    def _put(self, frame: Frame) -> None:
        if not self._is_begun:
            return
        for one in [frame] if self._keys is None else self._keys.sealed(frame, self._run.loop.now_us()):
            self._bus.send(one)

    def _hear(self, frame: Frame, time_us: int) -> None:
        if self._keys is not None:
            self._keys.hear(frame)
            for answer in self._keys.answer(frame, time_us) if self._is_begun else ():
                self._bus.send(answer)
        self._attack.hear_frame(frame, time_us)
        message = self._decoder.feed(frame, time_us)
        for word in singles(message) if message is not None else ():
            self._attack.hear(word, time_us)

    def _begin(self) -> None:
        self._is_begun = True
        self._attack.begin(self._run.loop.now_us())
        self._tick()

    def _tick(self) -> None:
        now_us = self._run.loop.now_us()
        if now_us >= self._injection.until_us:
            self._bus.power_off()
            return
        self._attack.tick(now_us)
        self._run.plant.timers.call_at(now_us + TICK_US, self._tick)
