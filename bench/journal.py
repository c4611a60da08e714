"""How long journals become, and how long a start takes to read them: ``python -m bench.journal small 160 10000``.

A site is played with so many cars, its journals never written anew. Then each machine's records are repeated under new
numbers of cars and tasks until as many cars have come as asked for, and are written through the real journal file and
the real compaction, which strikes as on a board: when the file has grown by so much. Told for each machine: records and
bytes that one car costs, the longest file, the file at the end, and the time to read it and to take up its state.
"""

import asyncio
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from bench._arguments import a_count, a_site, given
from bus_sim.campaign.trial import STEP_US, stage_of
from bus_sim.faults.scenario import FaultScenario
from bus_sim.run import run_until
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Arrivals
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.contract.codes import TokenKind
from onboard.core.site import Site, journal_owner
from onboard.holon.holon import Holon
from onboard.io.journal import GROWTH, LEAST_BYTES, FileJournal
from onboard.io.sealed import begin
from onboard.ports.journal import Entry
from onboard.systems.registry import compaction_for, factory_for
from onboard.ways.tokens import car_token

#: Arrivals and stays of the run that is repeated, s.
MEAN_S, SIGMA_S, STAY_S = 110.0, 30.0, 150.0
LIMIT_S = 4_000_000.0


def played(site: Site, name: str, cars: int) -> dict[int, list[Entry]]:
    """The journals of a run, by node-ID."""
    scenario = FaultScenario(name, 5, LIMIT_S, Arrivals(cars, MEAN_S, SIGMA_S, STAY_S))
    loop = VirtualTimeLoop()

    async def play() -> dict[int, list[Entry]]:
        stage = stage_of(site, scenario, loop)
        stage.run.start()
        for journal in stage.run.journals.values():
            journal.least_bytes = sys.maxsize
        await run_until(stage.run, lambda: stage.is_over, round(LIMIT_S * 1e6), STEP_US)
        return {node: journal.entries for node, journal in stage.run.journals.items()}

    return run_on(loop, play())


def repeated(entries: list[Entry], times: int, step: int) -> Iterator[Entry]:
    """The records again and again, cars and tasks under new numbers; who was still remembered is forgotten later."""
    cars = {(int(one["car_origin"]), int(one["car"])) for one in entries if "car" in one and "car_origin" in one}
    tokens = (int(one["number"]) for one in entries if one.get("kind") == TokenKind.CAR)
    cars |= {(number >> 16, number & 0xFFFF) for number in tokens}
    cars -= {(int(one["load_origin"]), int(one["load"])) for one in entries if one["record"] == "retired"}
    for again in range(times):
        by = again * step
        yield from (_shifted(entry, by) for entry in entries)
        for origin, number in sorted(cars):
            key = car_token(origin, number + by)
            left: Entry = {"record": "retired", "kind": int(key.kind), "number": key.number, "load_origin": origin}
            yield {**left, "load": number + by}


def _shifted(entry: Entry, by: int) -> Entry:
    fields = dict(entry)
    if entry.get("kind") == TokenKind.CAR or entry["record"] == "number":
        fields["number"] = int(entry["number"]) + by
    for name in ("car", "load", "task"):
        if name in entry:
            fields[name] = int(entry[name]) + by
    return fields


def grown(site: Site, entries: Iterator[Entry]) -> tuple[list[Entry], int]:
    """What is left after all of ``entries``, and the longest that the file was, bytes; only the file is left out."""
    fewer, kept, size, longest, least = compaction_for(site), list[Entry](), 0, 0, LEAST_BYTES
    for entry in entries:
        kept.append(entry)
        # A link and its blanks; the number is near enough.
        size += len(str(entry)) + 20
        longest = max(longest, size)
        if size > least:
            kept = fewer(kept)
            size = len(begin("bench", "0" * 16, kept)[0])
            least = max(LEAST_BYTES, GROWTH * size)
    return kept, longest


async def started(site: Site, node: int, entries: list[Entry]) -> tuple[int, float]:
    """Bytes of a real file with these entries; and how long it takes to read and to take up, s of processor time."""
    machine = site.machines[node]
    owner = journal_owner(site, machine)
    with tempfile.TemporaryDirectory() as folder:
        first = FileJournal(Path(folder), owner)
        first.replay()
        await first.compact(lambda _: entries)
        size = first.size_bytes
        await first.close()
        begin_s = time.process_time()
        again = FileJournal(Path(folder), owner)
        Holon(site, machine, factory_for(site, machine.kind), entries=again.replay())
        took_s = time.process_time() - begin_s
        await again.close()
    return size, took_s


def main() -> None:
    """Take site, cars played and cars asked for from the command line; print a row for each machine."""
    words = given(site=(a_site, "small"), cars=(a_count, 160), wanted=(a_count, 10_000))
    name, cars, wanted = words.site, words.cars, words.wanted
    site = find_site(name)
    journals = played(site, name, cars)
    numbers = [int(one["number"]) for entries in journals.values() for one in entries if one["record"] == "number"]
    print(f"{name}: {cars} cars played, repeated to {wanted}")
    for node, entries in journals.items():
        kept, longest = grown(site, repeated(entries, -(-wanted // cars), max(numbers)))
        size, took_s = asyncio.run(started(site, node, kept))
        bytes_a_car = sum(len(str(one)) + 20 for one in entries) / cars
        print(
            f"{site.machines[node].name:<8} {len(entries) / cars:6.1f} records, {bytes_a_car / 1000:5.1f} kB a car; "
            f"longest {longest / 1000:6.0f} kB; at the end {len(kept)} records, {size / 1000:.0f} kB, "
            f"read and taken up in {took_s * 1000:.0f} ms"
        )


if __name__ == "__main__":
    main()
