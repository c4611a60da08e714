"""Every scenario on every target of the bench; see ``hil/conftest.py`` for the options."""

from collections.abc import Callable
from pathlib import Path

import pytest

from hil.bench import Bench, Target
from hil.device import BenchError
from hil.play import missing, play
from hil.scenarios.scenario import BenchScenario
from onboard.io.settings import BusOpenError


def test_scenario(
    bench: Bench, target: Target, scenario: BenchScenario, place: Path, record_property: Callable[[str, object], None]
) -> None:
    """The device does what it should, and leaves nothing wrong behind."""
    lacking = missing(scenario, target)
    if lacking:
        pytest.skip(f"bench {bench.name}: {target.machine.name} has no {', '.join(lacking)}")
    try:
        outcome = play(bench, target, scenario, place)
    except (BenchError, BusOpenError) as error:
        pytest.fail(f"bench {bench.name}: {error}", pytrace=False)
    for name, value in outcome.properties().items():
        record_property(name, value)
    record_property("trace", str(place / "trace.log"))
    if not outcome.is_good:
        pytest.fail("\n".join([*outcome.lines(), f"trace: {place / 'trace.log'}"]), pytrace=False)
