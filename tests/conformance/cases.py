"""The case of each system, by the system's name."""

from importlib import import_module
from pathlib import Path

import pytest

from tests.conformance.case import Case

TESTS = Path(__file__).parents[1]


def _found() -> dict[str, Case]:
    modules = sorted(path.parent.name for path in TESTS.glob("*/case.py") if path.parent.name != "conformance")
    cases: list[Case] = [import_module(f"tests.{name}.case").CASE for name in modules]
    return {one.system: one for one in cases}


CASES = _found()
every_system = pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
