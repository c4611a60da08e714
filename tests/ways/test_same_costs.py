"""Ten thousand plans end when they always ended: who makes the search faster makes no plan worse.

What is stored is one checksum for the ten plans of each fleet: when each has done its work, and is in its refuge.
They are those of the search before it kept states and moves. Others' plans come from the same search, so a plan that
ends at another time may change those after it. A change that means to change plans writes the file anew,
`python -m tests.ways.test_same_costs`, and says so in docs/decisions.md.
"""

import random
import statistics
from pathlib import Path
from zlib import crc32

import pytest

from onboard.ways.sipp import NoRoute, Route
from tests.thinned import some
from tests.ways.fleets import SECOND, Fleet, park

STORED = Path(__file__).with_name("costs.txt")
#: Name: floors, positions on each, compartments, robots with a plan beside the one that asks, and how many fleets.
KINDS = {"3x10": (3, 10, 2, 1, 800), "5x20": (5, 20, 3, 3, 180), "10x40": (10, 40, 4, 8, 20)}
#: Fleets of each kind that the usual run of tests plays.
PLAYED = {"3x10": 30, "5x20": 10, "10x40": 6}
QUERIES = 10
CASES = [(kind, number) for kind, count in PLAYED.items() for number in some(range(KINDS[kind][-1]), count)]


def plans(kind: str, number: int) -> list[Route | NoRoute]:
    """Plans of one robot around those of the others of one fleet, as drawn from its number."""
    floors, length, compartments, busy, _ = KINDS[kind]
    rng = random.Random(f"{kind} {number}")
    fleet = Fleet(park(floors, length, compartments), rng)
    myself, *others = rng.sample(list(fleet.ends), busy + 1)
    fleet.busy(others)
    return [fleet.query(myself, 30 * SECOND) for _ in range(QUERIES)]


def checksum(found: list[Route | NoRoute]) -> str:
    """Of when each plan has done its work and comes to its refuge."""
    ends = [
        f"{plan.finish_us} {plan.legs[-1].end_us if plan.legs else 0}" if isinstance(plan, Route) else "none"
        for plan in found
    ]
    return f"{crc32(chr(10).join(ends).encode()):08x}"


def stored() -> dict[str, list[str]]:
    """Checksums by kind, in the order of the fleets' numbers."""
    found: dict[str, list[str]] = {}
    for line in STORED.read_text(encoding="utf-8").splitlines():
        kind, *sums = line.split()
        found.setdefault(kind, []).extend(sums)
    return found


@pytest.mark.parametrize(("kind", "number"), CASES)
def test_plans_end_when_they_always_ended(kind: str, number: int) -> None:
    found = plans(kind, number)
    assert checksum(found) == stored()[kind][number]
    # Where eight others have plans a search took 8,300 of these before states and moves were kept.
    assert statistics.mean(plan.pops for plan in found) <= 800


def test_ten_thousand_plans_are_stored() -> None:
    assert sum(len(sums) for sums in stored().values()) * QUERIES == 10_000


def renew() -> None:
    """Write what plans cost today, ten fleets a line."""
    lines = [
        " ".join((kind, *(checksum(plans(kind, number)) for number in range(first, first + 10))))
        for kind, (*_, count) in KINDS.items()
        for first in range(0, count, 10)
    ]
    STORED.write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    renew()
