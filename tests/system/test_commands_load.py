"""Each command of ``bus-sim`` loads what it needs, and nothing of the others: its first line does not wait for them."""

import subprocess
import sys

import pytest

from bus_sim.cli import COMMANDS, build_parser
from bus_sim.systems.registry import own_commands

#: Tells which of the modules that are named behind the first word are loaded where the words before it are read.
_LOADED = """
import sys
from bus_sim.cli import build_parser
words, looked_for = sys.argv[1].split(), sys.argv[2].split()
build_parser(words)
print(*[name for name in looked_for if name in sys.modules])
"""


@pytest.mark.parametrize(
    ("words", "not_loaded"),
    [
        ("--help", "asyncio numpy rich bus_sim.run onboard.controller onboard.config.site"),
        ("sites", "asyncio numpy rich bus_sim.run onboard.controller cantools"),
        ("import", "bus_sim.run bus_sim.campaign.command onboard.controller bus_sim.systems.car_park.demand"),
        ("run", "bus_sim.campaign.command bus_sim.attacks.command bus_sim.systems.graph.certify cantools"),
        ("campaign", "bus_sim.attacks.command bus_sim.systems.car_park.compare.command"),
    ],
)
def test_a_command_loads_nothing_of_the_others(words: str, not_loaded: str) -> None:
    run = subprocess.run(
        [sys.executable, "-c", _LOADED, words, not_loaded], capture_output=True, text=True, check=False
    )
    assert (run.returncode, run.stdout.strip(), run.stderr) == (0, "", "")


def test_every_command_has_a_help_of_its_own_that_the_words_lead_to(capsys: pytest.CaptureFixture[str]) -> None:
    every = COMMANDS | own_commands()
    assert len(every) >= 9
    for name in every:
        with pytest.raises(SystemExit):
            build_parser([name]).parse_args([name, "--help"])
        told = capsys.readouterr().out
        assert told.startswith(f"usage: bus-sim {name} [-h] ") and "positional arguments:" in told
