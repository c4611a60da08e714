"""``onboard conform``: play a fleet's part against one node on a bus, and judge its duties one by one."""

import argparse
import asyncio
import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from onboard import __version__
from onboard.config.arguments import Parser
from onboard.config.problems import ConfigError
from onboard.config.site import load_site
from onboard.conform.checks import Verdict
from onboard.conform.player import Player
from onboard.conform.report import NodeUnderTest, doubts, frame_words, junit, lines_of, protocol, status, totals
from onboard.conform.stage import Means, PlatformRun
from onboard.conform.suite import scenes_of, unlike, watchers_of
from onboard.contract.codes import CONTRACT_VERSION, KindCode
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.io.open_bus import BusOpenError, BusSettings, add_site_arguments, bus_settings, open_bus, parse_with_bus
from onboard.io.signals import ended_by
from onboard.ports.bus import Bus
from onboard.systems.contract import codecs_for
from onboard.systems.registry import part

MISTAKE = 2
EXAMPLES = """\
exit status: 0 every duty that was reached is kept; 1 one is broken, or the node was not heard; 2 a person's mistake

Nothing else that speaks may be on the bus: the kit speaks as all other machines of the site. What it plays makes the
node drive: nobody may be in its way. A car in the first compartment's bay, its output door open, lets it be judged
at work as well (--car).

examples:
  onboard conform -i socketcan -c can0 --site bench.toml --node 11 --kind robot
  onboard conform -i socketcan -c can0 --site bench.toml --node 11 --kind robot --car --power ./relay --junit out.xml
      ./relay is run with "on" or "off" as its last word
  onboard conform -i socketcan -c can0 --site lift.toml --node 11 --kind robot --car --lift ./platform
      ./platform is run with the lift's node-ID and a stop, and has the platform there in the time of its own run
  onboard conform -i socketcand -c fleet --bus-kwargs host=127.0.0.1 port=29536 --site level1 --node 11 --kind robot
"""


class ConformError(Exception):
    """A person's mistake, in one line with the remedy."""


def build_parser() -> argparse.ArgumentParser:
    """The command line of ``onboard conform``."""
    parser: argparse.ArgumentParser = Parser(
        prog="onboard conform",
        description=("Play a fleet's part against one node, and judge its duties one by one (docs/conform.md)."),
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add_site_arguments(parser)
    parser.add_argument("--node", type=int, required=True, metavar="NODE", help="node-ID of the node under test")
    parser.add_argument("--kind", required=True, metavar="KIND", help="what it is: robot")
    parser.add_argument(
        "--scene", action="append", default=[], metavar="SCENE", help="only this, and joining; repeatable"
    )
    parser.add_argument("--list", action="store_true", help="tell all checks with their duties, and stop")
    parser.add_argument(
        "--car", type=int, nargs="?", const=2_870, metavar="MM", help="a car of this wheelbase is in the bay"
    )
    parser.add_argument("--power", metavar="PROGRAM", help="switches the node: run with the word on or off")
    parser.add_argument(
        "--lift", metavar="PROGRAM", help="moves a platform: run with its lift's node-ID and the stop, from 1 on"
    )
    parser.add_argument(
        "--late", type=int, default=15, metavar="MS", help="how late a word may come (default: %(default)s)"
    )
    parser.add_argument("--junit", type=Path, metavar="FILE", help="write the result as JUnit's XML")
    parser.add_argument("--protocol", type=Path, metavar="FILE", help="write a protocol to sign, in Markdown")
    return parser


def main(argv: Sequence[str]) -> int:
    """Entry point; returns the exit status."""
    parser = build_parser()
    args = parser.parse_args(argv) if "--list" in argv else parse_with_bus(parser, argv)
    try:
        site = load_site(args.site)
        player = _player(args, site)
        if args.list:
            for one in player.findings.by_name.values():
                print(f"{one.check.duty:4} {one.check.name:40} {one.scene}")
            return 0
        _look_before(args)
        if other := unlike(site):
            print(f"onboard conform: site {site.name}: {doubts(other)}", file=sys.stderr)
        settings = bus_settings(args, BusSettings(interface="", channel="", bitrate=site.bitrate))
        asyncio.run(_run(player, settings, args.power, args.lift))
        return _tell(args, site, player, f"{settings.interface} {settings.channel}")
    except OSError as error:
        print(f"onboard conform: {error.filename}: {error.strerror}; name another file", file=sys.stderr)
        return MISTAKE
    except (ConfigError, BusOpenError, ConformError) as error:
        for line in str(error).splitlines():
            print(line if isinstance(error, ConfigError) else f"onboard conform: {line}", file=sys.stderr)
        return MISTAKE


def _player(args: argparse.Namespace, site: Site) -> Player:
    machine = site.machines.get(args.node)
    if machine is None:
        known = ", ".join(f"{node} ({one.name})" for node, one in site.machines.items())
        raise ConformError(f"--node {args.node}: no machine of site {site.name}; it has {known}")
    if machine.kind.name.lower() != args.kind:
        raise ConformError(f"--kind {args.kind}: {machine.name} is a {machine.kind.name.lower()} by the site file")
    if machine.kind is not KindCode.ROBOT or part(site.system, "conform") is None:
        raise ConformError(f"--kind {args.kind}: only robots of a car park can be judged yet; name a robot's node")
    _lifts(args, site)
    scenes = scenes_of(site)
    unknown = [name for name in args.scene if name not in {scene.name for scene in scenes}]
    if unknown:
        raise ConformError(f"--scene {unknown[0]}: not known; --list tells all")
    wanted = [scene for scene in scenes if not args.scene or scene.name in (scenes[0].name, *args.scene)]
    means = Means(args.power is not None, args.car is not None, args.car or 2_870, args.late * 1_000)
    codec = codecs_for(site).fleet
    return Player(
        site, args.node, codec, wanted, means, watchers_of(site), lambda name: print(f"-- {name}", flush=True)
    )


def _lifts(args: argparse.Namespace, site: Site) -> None:
    """Raises ``ConformError`` where the site's lifts cannot be played."""
    lifts = [one.name for one in site.machines.values() if one.kind is KindCode.LIFT]
    if len(lifts) > 1:
        what = "one lift is played at most; take a smaller site"
        raise ConformError(f"--site {site.name}: it has {', '.join(lifts)}; {what}")
    if lifts and args.lift is None and not args.list:
        what = "nobody moves its platform; name a program that does: --lift"
        raise ConformError(f"--site {site.name}: it has {lifts[0]}; {what}")


def _look_before(args: argparse.Namespace) -> None:
    """A quarter of an hour of play ends with these: a mistake in them is told before it. Raises ``OSError`` too."""
    programs = (
        ("--power", args.power, "the words on and off"),
        ("--lift", args.lift, "a lift's node-ID and the number of a stop"),
    )
    for option, program, words in programs:
        if program is not None and shutil.which(program) is None:
            raise ConformError(f"{option} {program}: no program that can be run; name one that takes {words}")
    for path in (args.junit, args.protocol):
        if path is not None:
            # A folder can be touched.
            path.open("ab").close()


@dataclass
class Bench:
    """The shell around a player: one bus, one clock, one switch."""

    player: Player
    bus: Bus
    power: str | None
    lift: str | None = None

    def __post_init__(self) -> None:
        self.loop = asyncio.get_running_loop()
        self.over: asyncio.Event = asyncio.Event()
        self.timer: asyncio.TimerHandle | None = None
        #: What is being switched or moved, each behind the one before.
        self.running: asyncio.Task[None] | None = None
        self.bus.subscribe(self._on_frame)
        self.player.start(self._now_us())
        self._carry_out()

    def _now_us(self) -> int:
        return round(self.loop.time() * 1_000_000)

    def _on_frame(self, frame: Frame, time_us: int) -> None:
        self.player.receive(frame, time_us)
        self._carry_out()

    def _wake(self) -> None:
        self.timer = None
        self.player.wake(self._now_us())
        self._carry_out()

    def _carry_out(self) -> None:
        self.player.hand_out(self.bus.send, self._switch, self._move)
        if self.player.is_over:
            self.over.set()
            return
        if self.timer is not None:
            self.timer.cancel()
        self.timer = self.loop.call_at(self.player.next_us() / 1_000_000, self._wake)

    def _switch(self, on: bool) -> None:
        self._begin(self.power, "on" if on else "off")

    def _move(self, ride: PlatformRun) -> None:
        self._begin(self.lift, str(ride.node), str(ride.stop))

    def _begin(self, program: str | None, *words: str) -> None:
        if program is not None:
            self.running = self.loop.create_task(self._run(self.running, program, *words))

    async def _run(self, before: "asyncio.Task[None] | None", program: str, *words: str) -> None:
        if before is not None:
            await before
        run = await asyncio.create_subprocess_exec(program, *words)
        try:
            await run.wait()
        finally:
            if run.returncode is None:
                run.terminate()
                await run.wait()

    async def end(self) -> None:
        """Nothing that it has begun goes on: what switches the node or moves a platform neither."""
        if self.timer is not None:
            self.timer.cancel()
        if self.running is not None:
            self.running.cancel()
            await asyncio.wait({self.running})


async def _run(player: Player, settings: BusSettings, power: str | None, lift: str | None) -> None:
    bus = await open_bus(settings)
    try:
        bench = Bench(player, bus, power, lift)
        lost = bench.loop.create_task(bus.wait_lost())
        over = bench.loop.create_task(bench.over.wait())
        try:
            with ended_by(bench.loop, lambda _: bench.over.set()):
                await asyncio.wait((lost, over), return_when=asyncio.FIRST_COMPLETED)
        finally:
            await bench.end()
        if lost.done():
            raise ConformError(f"the bus is gone: {lost.result()}; what was judged until then is lost")
        lost.cancel()
    finally:
        await bus.close()


def _tell(args: argparse.Namespace, site: Site, player: Player, bus: str) -> int:
    machine, findings = site.machines[args.node], player.findings
    date = datetime.now(UTC).isoformat(timespec="seconds")
    program = f"onboard {__version__}"
    subject = NodeUnderTest(
        args.node,
        machine.name,
        args.kind,
        site.name,
        site.digest,
        CONTRACT_VERSION,
        program,
        bus,
        date,
        tuple(unlike(site)),
    )
    for one in findings.of(Verdict.FAILED):
        print("\n".join(lines_of(one, frame_words)))
    print(totals(findings))
    if args.junit is not None:
        args.junit.write_text(junit(findings, subject, frame_words), encoding="utf-8")
    if args.protocol is not None:
        args.protocol.write_text(protocol(findings, subject, frame_words), encoding="utf-8")
    return status(findings)
