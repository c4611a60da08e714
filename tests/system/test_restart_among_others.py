"""A robot that is started again while the others plan, bid and drive goes on from where it is, and wrongs nobody."""

from pathlib import Path

from bus_sim import sites
from bus_sim.cli import main as bus_sim
from onboard.cli import main as onboard

SITE = Path(sites.__file__).parent / "small.toml"
RUN = "run small --random 40 15 --cars 5 --seed 77 --speed max --no-web --devices"
CRASH = "crash:target=MR1,at_s=80,restart_s=5"


def test_a_plan_heard_while_a_robot_recovers_does_not_move_it(tmp_path: Path) -> None:
    """It planned from the end of a way not driven, with its shuttle out, and woke for ever at one moment."""
    log = tmp_path / "run.log"
    assert bus_sim([*RUN.split(), "--fault", CRASH, "--trace", str(log)]) == 0
    assert onboard(["trace", "check", str(log), "--site", str(SITE)]) == 0
