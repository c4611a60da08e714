"""The page about the bench names every scenario, capability and kind, and no other."""

import re
from pathlib import Path

from hil.bench import Capability, TargetKind
from hil.scenarios.registry import SCENARIOS

PAGE = (Path(__file__).parents[2] / "docs" / "bench.md").read_text(encoding="utf-8")


def rows(head: str) -> list[str]:
    """First cells of the table that begins so."""
    table = PAGE[PAGE.index(f"\n| {head} |") :].strip().split("\n\n")[0].splitlines()[2:]
    return [re.split(r" \|", line)[0].removeprefix("| ").strip("`") for line in table]


def test_the_page_has_every_scenario_capability_and_kind() -> None:
    assert rows("scenario") == [scenario.name for scenario in SCENARIOS]
    assert rows("capability") == [str(one) for one in Capability]
    assert rows("kind") == [str(one) for one in TargetKind]
