"""Every scenario on every target of the bench; see ``hil/conftest.py`` for the options."""

from collections.abc import Callable
from pathlib import Path

import pytest

from hil.bench import Bench, Target
from hil.play import missing, play
from hil.scenarios.scenario import Scenario


def test_scenario(
    bench: Bench, target: Target, scenario: Scenario, place: Path, record_property: Callable[[str, object], None]
) -> None:
    """The device does what it should, and leaves nothing wrong behind."""
    lacking = missing(scenario, target)
    if lacking:
        pytest.skip(f"bench {bench.name}: {target.machine.name} has no {', '.join(lacking)}")
    outcome = play(bench, target, scenario, place)
    for name, value in outcome.properties().items():
        record_property(name, value)
    record_property("trace", str(place / "trace.log"))
    assert outcome.is_good, "\n".join([*outcome.lines(), f"trace: {place / 'trace.log'}"])
