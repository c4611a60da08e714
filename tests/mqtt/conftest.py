"""Logs that several files read."""

from pathlib import Path

import pytest

from tests.mqtt.logs import record


@pytest.fixture(scope="session")
def small_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One car in and out of the small site."""
    return record(tmp_path_factory.mktemp("small") / "small.log", "small", "--one-car", "60")
