"""``bus-sim certify``: can robots stick on this graph under these rules, and how many robots are best?"""

import argparse
import re
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple, TypeVar

from rich.console import Console

from bus_sim.engine import Engine, add_where_options, engine_of, shown
from bus_sim.options import RunOptions
from bus_sim.sites import SiteNotFoundError, find_site
from bus_sim.systems.graph.against_optimum import compare
from bus_sim.systems.graph.certify.certificate import (
    MOST_LISTED,
    ROWS,
    Certificate,
    certify,
    count_stuck,
    number_of_task_sets,
    stuck_lines,
)
from bus_sim.systems.graph.certify.counterexample import play_file, play_on_bus, write_counterexample
from bus_sim.systems.graph.certify.model import GraphModel
from bus_sim.systems.graph.certify.throughput import Pace, Throughput, measure
from onboard.systems.graph.network import Graph, complete, cube, grid, ring
from onboard.systems.graph.rules import Rules
from onboard.systems.graph.site import FactoryGraph

T = TypeVar("T")
#: Cases that are compared with the optimum at most.
MOST_CASES = 20
_SPEC = re.compile(r"(?:ring:(\d{1,2})|complete:(\d{1,2})|cube:([2-6])|grid:(\d{1,2})x(\d{1,2}))")
_RULES = [rules.value for rules in Rules]

HELP = """\
rules:
  paper          an edge is granted where it is free; who is told to stop waits on its edge
  keep           besides, a node with traffic at it keeps its last free edge and refuses it to the neighbour
  keep-on-notice that rule to the letter: a node counts its free edges when a neighbour has reserved one to it, and lets
                 go what it keeps when a neighbour has released one
  edge-and-node  an edge is granted together with a slot in the node behind it; who waits does so in a node

All interleavings of all task sets are searched. The number of robots with the best throughput is proposed among those
that are certified, measured by simulation.

exit status: 0 certified; 1 not certified, or undecided; 2 a mistake in the command line or in a file
"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """The options of ``certify``, and its description."""
    parser.description, parser.formatter_class = HELP, argparse.RawDescriptionHelpFormatter
    parser.add_argument(
        "site",
        nargs="?",
        help="name of a shipped graph site, a site file, or ring:N, complete:N, grid:RxC, cube:D",
    )
    parser.add_argument("--robots", type=int, metavar="K", help="number of robots (default: the site's)")
    parser.add_argument("--rules", choices=_RULES, help="the node agents' rules (default: the site's, else paper)")
    parser.add_argument("--capacity", type=int, metavar="N", help="slots of a node, for edge-and-node (default: K)")
    parser.add_argument("--up-to", type=int, default=5, metavar="K", help="most robots to propose (default: 5)")
    parser.add_argument("--counterexample", type=Path, metavar="FILE", help="write it here, for bus-sim certify --play")
    parser.add_argument("--play", type=Path, metavar="FILE", help="play a counterexample step by step instead")
    parser.add_argument("--bus", action="store_true", help="with --play: on the virtual bus, under --rules if given")
    parser.add_argument("--trace", type=Path, metavar="FILE", help="with --play --bus: write a candump log")
    parser.add_argument(
        "--optimum",
        type=int,
        metavar="CASES",
        help="instead, 1 to 4 robots on a 3x3 grid on the bus: time to the last goal over the exact optimum",
    )
    add_where_options(parser)
    parser.add_argument(
        "--count", action="store_true", help="count the task sets that can stick, under --rules or under each rule set"
    )
    parser.add_argument("--sample", type=int, metavar="N", help="with --count: of so many task sets that are drawn")
    parser.add_argument("--seed", type=int, default=1, metavar="S", help="with --sample: the draw (default: 1)")
    parser.add_argument("--table", action="store_true", help="count the task sets that can stick on known graphs")


def run(args: argparse.Namespace) -> int:
    """The command. Raises ``SiteNotFoundError`` or ``ConfigError`` for a mistake in the command line or a file."""
    engine = engine_of(args, chunk=1)
    if args.table:
        return _table(engine)
    if args.optimum is not None:
        return _optimum(args.optimum, engine)
    if args.play is not None and args.bus:
        rules = Rules(args.rules) if args.rules is not None else None
        return play_on_bus(args.play, rules, RunOptions(trace=args.trace, limit_s=3_600))
    if args.play is not None:
        return play_file(args.play)
    if args.site is None:
        raise SiteNotFoundError("certify: no graph named; name a graph site, or such as ring:6")
    graph, site = _graph(args.site)
    robots = args.robots if args.robots is not None else (len(site.robots) if site is not None else 2)
    if not 1 <= robots <= len(graph.nodes):
        raise SiteNotFoundError(f"--robots {robots}: must be 1 to {len(graph.nodes)}, a node for each to start from")
    rules = Rules(args.rules) if args.rules is not None else (site.rules if site is not None else Rules.PAPER)
    if args.capacity is not None and args.capacity < 1:
        raise SiteNotFoundError(f"--capacity {args.capacity}: must be 1 or more")
    capacity = args.capacity or (site.capacity if site is not None else robots)
    if args.count:
        return _count(graph, robots, [rules] if args.rules is not None else list(Rules), capacity, args)
    if args.sample is not None:
        raise SiteNotFoundError("--sample: only with --count; a certificate looks at all task sets")
    found = certify(graph, robots, rules, capacity)
    _say(found, f"{args.site}, {robots} robots, rules {rules.value}", args.counterexample, graph, rules, capacity)
    _propose(graph, rules, capacity if args.capacity or site else None, min(args.up_to, len(graph.nodes)), engine)
    return 0 if found.certified else 1


def _graph(text: str) -> tuple[Graph, FactoryGraph | None]:
    spec = _SPEC.fullmatch(text)
    if spec is not None:
        nodes, joined, dimensions, rows, columns = (int(one) if one else 0 for one in spec.groups())
        if dimensions:
            return cube(dimensions), None
        if max(nodes, joined) > 2 or min(rows, columns) > 1:
            return (ring(nodes) if nodes else complete(joined) if joined else grid(rows, columns)), None
        raise SiteNotFoundError(f"{text}: too small; a ring or complete graph has 3 nodes or more, a grid 2x2 or more")
    site = find_site(text)
    if not isinstance(site, FactoryGraph):
        raise SiteNotFoundError(f"{text}: a {site.called}, no graph; name a graph site, or such as ring:6")
    return site.graph, site


def _say(found: Certificate, what: str, file: Path | None, graph: Graph, rules: Rules, capacity: int) -> None:
    verdict = {True: "deadlock-free under these rules", False: "not certified", None: "undecided"}[found.certified]
    print(f"{what}: {verdict}\n{found.reason}")
    if found.stuck is not None:
        print("\n".join(stuck_lines(found.stuck)))
        if file is not None:
            write_counterexample(file, graph, rules, capacity, found.stuck)
            print(f"written to {file}; play it: bus-sim certify --play {file} [--bus [--rules edge-and-node]]")


class _Proposal(NamedTuple):
    """So many robots on a graph: whether they are certified, and what they do in an hour; None before it is known."""

    graph: Graph
    rules: Rules
    room: int
    robots: int
    certified: bool | None = None
    result: Throughput | None = None

    def line(self) -> str:
        """One row of the table."""
        assert self.result is not None, "told when it is known"
        words = {True: "yes", False: "no", None: "?"}[self.certified]
        stuck = f"  stuck after {self.result.stuck_at_s:.0f} s" if self.result.stuck_at_s is not None else ""
        per_hour = self.result.per_hour
        return f"{self.robots:6}  {words:9}  {per_hour:7.1f}  {per_hour / self.robots:7.1f}{stuck}"


def _proposed(one: _Proposal) -> _Proposal:
    certified = certify(one.graph, one.robots, one.rules, one.room, limit=300_000).certified
    result = measure(GraphModel(one.graph, one.rules, one.room), one.robots, _pace(one.graph))
    return one._replace(certified=certified, result=result)


def _propose(graph: Graph, rules: Rules, capacity: int | None, most: int, engine: Engine) -> None:
    """Throughput by number of robots, and the best that is certified."""
    asked = [_Proposal(graph, rules, capacity or robots, robots) for robots in range(1, most + 1)]
    found = sorted(_shown(engine(_proposed, asked), len(asked)), key=lambda one: one.robots)
    best: tuple[float, int] | None = None
    print("\nrobots  certified  tasks/h  a robot")
    for one in found:
        print(one.line())
        result = one.result
        if one.certified and result is not None and (best is None or result.per_hour > best[0]):
            best = (result.per_hour, one.robots)
    print(f"proposed: {best[1]} robots, {best[0]:.1f} tasks an hour" if best else "proposed: none is certified")


def _shown(results: Iterator[T], total: int) -> Iterator[T]:
    return shown(results, total, "certify", Console(stderr=True))


def _pace(graph: Graph) -> Pace:
    """A metre a second; a graph without measures has edges of ten seconds."""
    return Pace() if max(graph.lengths_mm.values()) >= 1000 else Pace(speed_mm_s=1, load_s=0.5)


def _optimum(cases: int, engine: Engine) -> int:
    site = find_site("graph")
    if not isinstance(site, FactoryGraph) or not 1 <= cases <= MOST_CASES:
        raise SiteNotFoundError(f"--optimum {cases}: must be 1 to {MOST_CASES}; a case of 4 robots takes 10 s")
    print("robots  cases    mean   worst")
    compared = partial(_compared, site, cases)
    for _, line in sorted(_shown(engine(compared, range(1, 5)), 4)):
        print(line, flush=True)
    return 0


def _compared(site: FactoryGraph, cases: int, robots: int) -> tuple[int, str]:
    return robots, compare(site, grid(3, 3, 6000), robots, cases).line()


def _count(graph: Graph, robots: int, rules: list[Rules], capacity: int, args: argparse.Namespace) -> int:
    """So many of all task sets, or of those drawn, can stick; 0 where none can under any of ``rules``."""
    if graph.dead_ends:
        raise SiteNotFoundError(f"{args.site}: N{graph.dead_ends[0]} is a dead end, from which nobody comes back")
    every = number_of_task_sets(graph, robots)
    if args.sample is None and every > MOST_LISTED:
        raise SiteNotFoundError(f"--count: {every} task sets of {robots} robots; draw some of them with --sample N")
    if args.sample is not None and not 0 < args.sample <= every:
        raise SiteNotFoundError(f"--sample {args.sample}: must be 1 to {every}, as many as there are")
    drawn = f", {args.sample} of them drawn with seed {args.seed}" if args.sample is not None else ""
    print(f"{args.site}, {robots} robots: {every} task sets{drawn}\n{'rules':14}  can stick")
    sample = (args.sample, args.seed) if args.sample is not None else None
    stuck = 0
    for one in rules:
        _, found = count_stuck(graph, robots, one, capacity, sample=sample)
        print(f"{one.value:14}  {found:9}", flush=True)
        stuck += found
    return 1 if stuck else 0


def _table(engine: Engine) -> int:
    print(f"{'graph':10} robots  task sets  {'rule off':>8}  {'rule on':>8}  {'to the letter':>13}  seconds")
    for _, line in sorted(_shown(engine(_counted, range(len(ROWS))), len(ROWS))):
        print(line, flush=True)
    return 0


def _counted(number: int) -> tuple[int, str]:
    row, began = ROWS[number], time.perf_counter()
    sets, off = count_stuck(row.graph, row.robots, Rules.PAPER, sample=row.sample)
    _, on = count_stuck(row.graph, row.robots, Rules.KEEP, sample=row.sample)
    _, letter = count_stuck(row.graph, row.robots, Rules.KEEP_ON_NOTICE, sample=row.sample)
    drawn = f"  drawn with seed {row.sample[1]}" if row.sample is not None else ""
    took_s = time.perf_counter() - began
    return number, f"{row.name:10} {row.robots:6}  {sets:9}  {off:8}  {on:8}  {letter:13}  {took_s:7.1f}{drawn}"
