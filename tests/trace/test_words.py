"""Every system's logs in its own words: loads, places, rights and deeds; nobody else's."""

import re
from pathlib import Path

import pytest

from onboard.systems.registry import system_names
from onboard.trace.cli import main
from tests.web.logs import file_of, log_of

#: What a run of each system must be told with: by ``calls``, by ``why`` and by ``dump``.
WORDS = {
    "small": (["park car IOC1/1", "IOC1 to anywhere"], ["takes the car at IOC1"], ["token p(2,2)", "car IOC1/1"]),
    "graph": (["transport order 4", "N1 to N7"], ["drives from N"], ["token slot 1 of N5", "stop1 N4", "order 4"]),
    "terminal": (["transport box B4", "S2 to S10"], ["drives through L"], ["token slot 1 of L3", "box B7", "lane L11"]),
    "turning": (["machine order 1, 6 x pin"], ["turns order 1"], ["drawing pin", "material brass", "total 226 ct"]),
    "mapd": (["transport task 0", " steps", ", finished"], ["delivers task", "goes to pick up task"], ["token cell "]),
    "cell": (["reach part 1", "(10.0, 10.0) m to (40.0, 30.0) m"], ["carries the part"], ["token part 1", "part 1"]),
}
#: Words of a car park, and its way of writing places.
FOREIGN = re.compile(r"\bcars?\b|\bp\(\d")


def _told(capsys: pytest.CaptureFixture[str], *words: str | Path) -> str:
    assert main([str(word) for word in words]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("name", WORDS)
def test_logs_are_told_in_the_words_of_the_system(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    log, site = log_of(name), file_of(name)
    calls = _told(capsys, "calls", log, "--site", site)
    tasks = _told(capsys, "why", log, "--site", site)
    reports = "".join(_told(capsys, "why", log, line.split()[0], "--site", site) for line in tasks.splitlines()[:4])
    sequence = _told(capsys, "sequence", log, tasks.split()[0], "--site", site)
    dump = _told(capsys, "dump", log, "--decode", "--site", site)
    for text, wanted in zip((calls, tasks + reports, dump), WORDS[name], strict=True):
        assert [word for word in wanted if word not in text] == []
    if name != "small":
        assert [
            line for text in (calls, reports, sequence, dump) for line in text.splitlines() if FOREIGN.search(line)
        ] == []


def test_every_system_that_ships_is_looked_at_here() -> None:
    assert len(system_names()) == len(WORDS)


def test_without_a_site_loads_are_neutral(capsys: pytest.CaptureFixture[str]) -> None:
    calls = _told(capsys, "calls", log_of("small"))
    assert "park load node 1/1, task node 1/1" in calls and not re.search(r"\bcar\b", calls)
