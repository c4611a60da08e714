"""A site in the guest: the plant and every controller a process in a namespace of its own, two CAN interfaces each.

Runs in the guest. ``can0`` of every namespace is the fleet bus, ``can1`` of a machine's its device bus, whose other end
the plant holds. Everything that is said is in the machines' logs, and ``candump`` of can-utils records the bus twice:
as a further node hears it, and outside, where the interface tells who sent.
"""

import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from bus_sim.cli import main as bus_sim
from hil.guest.forked import Forked, Main
from hil.guest.initrd import WORK
from hil.guest.listener import CandumpListener, NotHeardError
from hil.guest.mesh import Mesh, hand_out_boards, inside, join_pair, run
from onboard.cli import main as onboard
from onboard.config.site import parse_site
from onboard.io.pycan import open_python_can
from onboard.systems.contract import codecs_for

#: Further nodes of the fleet bus: the simulated plant, which only listens there, and the tools of a person.
PLANT, TOOLS = "plant", "tools"
#: The guest's own memory: a journal is synchronised after every entry.
JOURNALS = f"{WORK}/journals"
#: A receive buffer of 8 MiB: the emulated processor is late at times.
_CANDUMP = ("candump", "-L", "-r", "8388608")


@dataclass(frozen=True, slots=True)
class RunRequest:
    """What the host asks for: ``order.json`` of the share. ``begin`` are the plant's words after its buses."""

    machines: list[str]
    begin: list[str]

    @classmethod
    def read(cls, share: Path) -> "RunRequest":
        """The host's order. Raises ``OSError``, ``KeyError``."""
        words = json.loads((share / "order.json").read_text(encoding="utf-8"))
        return cls(words["machines"], words["begin"])


class SiteRun:
    """All processes of one run; their output lies in ``share``."""

    def __init__(self, share: Path, order: RunRequest) -> None:
        self.share = share
        self.order = order
        self.begin_s = time.monotonic()
        self.processes: dict[str, subprocess.Popen[bytes] | Forked] = {}

    def prepare(self) -> None:
        """What every process would do for itself first, and what it imports late: once, before the forks."""
        codecs_for(parse_site((self.share / "site.toml").read_text(encoding="utf-8"), "site.toml"))
        assert callable(open_python_can)

    def connect(self) -> Mesh:
        """The fleet bus as a mesh, and a device bus for each machine."""
        mesh = Mesh([*self.order.machines, PLANT, TOOLS])
        self.connect_devices()
        return mesh

    def connect_boards(self, bitrate: int) -> None:
        """The fleet bus over the guest's CAN controllers, and a device bus for each machine."""
        hand_out_boards([*self.order.machines, PLANT, TOOLS], bitrate)
        self.connect_devices()

    def connect_devices(self) -> None:
        """``can1`` of each machine's namespace; the plant's end is called as ``device_channel`` says."""
        for name in self.order.machines:
            join_pair(PLANT, device_channel(name), name, "can1")

    def record(self) -> None:
        """Write down the fleet bus as a further node hears it."""
        self.start("candump", [*inside(TOOLS), *_CANDUMP, "can0"], "fleet.log")

    def record_outside(self) -> None:
        """Write down the mesh as seen from outside, where the interface tells who sent."""
        self.start("candump-outside", [*_CANDUMP, "any"], "outside.log")

    def start_plant(self, *, stdin: int | None = None) -> None:
        """The simulator without any controller: it moves bodies, and has no say on the fleet bus.

        ``stdin`` is a descriptor that it reads a person's keys from.
        """
        words = ["run", "site.toml", "--bus", "socketcan:can0"]
        for name in self.order.machines:
            words += ["--without", name, "--bus", f"{name}=socketcan:{device_channel(name)}"]
        self._fork(PLANT, bus_sim, [*words, *self.order.begin], f"{PLANT}.txt", stdin=stdin)

    def start_machines(self) -> None:
        """Every machine runs the ordinary program with its own file."""
        for name in self.order.machines:
            (self.share / f"{name}.toml").write_text(_machine_file(name), encoding="utf-8")
            self.start_machine(name, f"{name}.txt")

    def start_machine(self, name: str, output: str) -> None:
        """One of them, for the first time or again; what it says goes to this file."""
        self._fork(name, onboard, ["--machine", f"{name}.toml", "--journal", f"{JOURNALS}/{name}"], output)

    def _fork(self, name: str, main: Main, words: Sequence[str], output: str, stdin: int | None = None) -> None:
        self.processes[name] = Forked(main, words, namespace=name, folder=self.share, output=output, stdin=stdin)

    def start(self, name: str, words: Sequence[str], output: str) -> None:
        """Start a program in the shared folder; both its outputs go to one file there."""
        with (self.share / output).open("wb") as out:
            self.processes[name] = subprocess.Popen(
                words,
                cwd=self.share,
                stdin=subprocess.DEVNULL,
                stdout=out,
                stderr=subprocess.STDOUT,
            )

    def tool(self, *words: str) -> str:
        """Run a person's program on the fleet bus to its end."""
        return run(*inside(TOOLS), *words)

    def wait(self, listener: CandumpListener, what: str, is_there: Callable[[], bool], limit_s: float) -> None:
        """Wait for something that the bus tells, and put it into the story. Raises ``NotHeardError``."""
        listener.wait(what, is_there, limit_s)
        self.tell(what)

    def tell(self, what: str) -> None:
        """A line of the scene's story, with its seconds."""
        print(f"{self.now_s():6.1f} s  {what}", flush=True)

    def now_s(self) -> float:
        """Since the scene's beginning, in the guest's time."""
        return time.monotonic() - self.begin_s

    def end(self, names: Sequence[str], limit_s: float = 20.0) -> dict[str, int]:
        """Tell these processes to end, and wait; their exit statuses."""
        for name in names:
            self.processes[name].terminate()
        return self.statuses(names, limit_s)

    def statuses(self, names: Sequence[str], limit_s: float) -> dict[str, int]:
        """Wait for the end of these processes; what did not end is killed and has a negative status."""
        found = {}
        for name in names:
            process = self.processes[name]
            try:
                found[name] = process.wait(limit_s)
            except (subprocess.TimeoutExpired, TimeoutError):
                process.kill()
                found[name] = process.wait()
        return found


def device_channel(machine: str) -> str:
    """The plant's end of a machine's device bus."""
    return f"d{machine}"


def _machine_file(name: str) -> str:
    where = 'interface = "socketcan"\n'
    return (
        f'[machine]\nname = "{name}"\nsite = "site.toml"\n\n'
        f'[fleet_bus]\nchannel = "can0"\n{where}\n[device_bus]\nchannel = "can1"\n{where}'
    )


def play(scene: Callable[[SiteRun], dict[str, object]]) -> int:
    """Run a scene on the folder that the command line names, and leave what it found as ``found.json``."""
    share = Path(sys.argv[1])
    one = SiteRun(share, RunRequest.read(share))
    try:
        found = scene(one)
    except (NotHeardError, RuntimeError) as error:
        print(error)
        return 1
    finally:
        for process in one.processes.values():
            process.kill()
    (share / "found.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
    return 0
