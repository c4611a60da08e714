"""Interfaces that are gone, late and back, again and again, on a site that works. Runs in the guest (``cycles.py``)."""

import json
import socket
import sys

from hil.guest.listener import CandumpListener
from hil.guest.mesh import bring_up, run
from hil.guest.site_run import TOOLS, SiteRun, play
from onboard.contract.codes import MachineState, TaskPhase
from onboard.contract.messages import Heartbeat, TaskReport
from onboard.core.frame import Frame
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder

#: Where an interface is while it is gone: for whom it was taken from, an adapter that was pulled out.
DRAWER = "drawer"
#: What happens to a machine, in turn. ``can0`` is its fleet bus, ``can1`` its device bus.
GONE, DEVICE_GONE, LATE = "fleet bus gone and back", "device bus gone and back", "started before its bus was there"
KINDS = (GONE, LATE, DEVICE_GONE)
#: Heartbeats of another machine while it is gone: three and its neighbours call it silent; one, and nobody noticed.
AWAY_BEATS = (1, 4, 2, 6)
#: Patience of the scene, s of the guest's time; ``cycles.py`` judges what was measured.
LIMIT_S = 120.0
_TAKING_PART = (MachineState.IDLE, MachineState.WORKING, MachineState.WAITING)


class Watch:
    """What the heartbeats of a site say, as they come."""

    def __init__(self, listener: CandumpListener, nodes: set[int]) -> None:
        self.listener = listener
        self._nodes = nodes
        self._decoder = Decoder(fleet_codec())
        self._read = 0
        self._last: dict[int, Heartbeat] = {}
        self._counts = dict.fromkeys(nodes, 0)
        #: Tasks that are done.
        self.done = 0

    def take(self) -> None:
        """Look at all that has come."""
        frames = self.listener.frames
        while self._read < len(frames):
            identifier, _, data = frames[self._read].partition("#")
            message = self._decoder.feed(Frame(int(identifier, 16), bytes.fromhex(data), len(identifier) > 3), 0)
            if isinstance(message, Heartbeat) and message.sender in self._nodes:
                self._last[message.sender] = message
                self._counts[message.sender] += 1
            elif isinstance(message, TaskReport) and message.phase is TaskPhase.DONE:
                self.done += 1
            self._read += 1

    def count(self, node: int) -> int:
        """Heartbeats of a machine so far."""
        self.take()
        return self._counts[node]

    def is_car_in(self) -> bool:
        """Whether the one car that comes has been put away."""
        self.take()
        return self.done > 0

    def forget(self) -> None:
        """From now on only news counts."""
        self.listener.read()
        self.take()
        self._last.clear()

    def all_agree(self) -> bool:
        """Whether every machine takes part, and all know the same plans."""
        self.take()
        beats = list(self._last.values())
        return (
            len(beats) == len(self._nodes)
            and all(beat.state in _TAKING_PART for beat in beats)
            and len({beat.mirror_digest for beat in beats}) == 1
        )


class Cycles:
    """One machine after the other loses an interface."""

    def __init__(self, site: SiteRun, nodes: dict[str, int], watch: Watch) -> None:
        self._site = site
        self._nodes = nodes
        self._watch = watch

    def play(self, number: int) -> dict[str, object]:
        """One cycle; who, what, and after how many seconds of the guest all took part again."""
        kind = KINDS[number % len(KINDS)]
        names = list(self._nodes)
        name = names[number // len(KINDS) % len(names)]
        witness = next(one for one in names if one != name)
        channel = "can1" if kind == DEVICE_GONE else "can0"
        if kind == LATE:
            self._site.processes[name].kill()
            self._site.processes[name].wait()
        run("ip", "-n", name, "link", "set", channel, "netns", DRAWER)
        if kind == LATE:
            self._site.start_machine(name, f"{name}-{number + 1}.txt")
        self._pass_beats(witness, AWAY_BEATS[number % len(AWAY_BEATS)])
        run("ip", "-n", DRAWER, "link", "set", channel, "netns", name)
        # As the board's networkd does with an interface that has come.
        bring_up(name, channel)
        return {"machine": name, "kind": kind, "took_s": self.wait_until_all_agree(f"{number + 1}: {name}, {kind}")}

    def wait_until_all_agree(self, what: str) -> float:
        """Seconds of the guest from now on."""
        begin_s = self._site.now_s()
        self._watch.forget()
        self._site.wait(self._watch.listener, what, self._watch.all_agree, LIMIT_S)
        return round(self._site.now_s() - begin_s, 1)

    def _pass_beats(self, name: str, beats: int) -> None:
        node, before = self._nodes[name], self._watch.count(self._nodes[name])
        what = f"{beats} heartbeats of {name}"
        self._watch.listener.wait(what, lambda: self._watch.count(node) >= before + beats, LIMIT_S)


def scene(site: SiteRun) -> dict[str, object]:
    """All cycles of the host's plan, then the plant's run to its end."""
    plan = json.loads((site.share / "plan.json").read_text())
    nodes: dict[str, int] = plan["nodes"]
    site.prepare()
    site.connect()
    run("ip", "netns", "add", DRAWER)
    site.record()
    watch = Watch(CandumpListener(TOOLS), set(nodes.values()))
    cycles = Cycles(site, nodes, watch)
    site.start_machines()
    here, keys = socket.socketpair()
    site.start_plant(stdin=here.fileno())
    keys.send(b"i")
    # Rights to the car and to its place live through all cycles.
    site.wait(watch.listener, "the car is in", watch.is_car_in, LIMIT_S)
    cycles.wait_until_all_agree("all take part")
    outcomes = [cycles.play(number) for number in range(plan["cycles"])]
    keys.send(b"o")
    # Closing it would not do: the machines that were forked since have it too.
    keys.shutdown(socket.SHUT_WR)
    status = site.statuses(["plant"], plan["plant_s"])
    site.tell("the plant's run is over")
    status |= site.end(list(nodes))
    site.end(["candump"])
    return {"cycles": outcomes, "status": status}


if __name__ == "__main__":
    sys.exit(play(scene))
