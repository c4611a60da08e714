"""A robot that is started again while the others plan, bid and drive goes on from where it is, and wrongs nobody."""

from pathlib import Path

from bus_sim import sites
from bus_sim.cli import main as bus_sim
from onboard.cli import main as onboard
from onboard.core.messages import Progress
from onboard.trace.candump_reader import CandumpReader
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder

MR2 = 12
SITE = Path(sites.__file__).parent / "small.toml"
RUN = "run small --random 40 15 --cars 5 --seed 77 --speed max --no-web --devices"
CRASH = "crash:target=MR1,at_s=80,restart_s=5"


def test_a_plan_heard_while_a_robot_recovers_does_not_move_it(tmp_path: Path) -> None:
    """It planned from the end of a way not driven, with its shuttle out, and woke for ever at one moment."""
    log = tmp_path / "run.log"
    assert bus_sim([*RUN.split(), "--fault", CRASH, "--trace", str(log)]) == 0
    assert onboard(["trace", "check", str(log), "--site", str(SITE)]) == 0


#: Of `bus-sim campaign small --seeds 1-2000 --faults two-crashes --apart 20`, seed 35.
TURNED_AWAY = """
[scenario]
site = "small"
seed = 35
limit_s = 1642
[demand]
cars = 6
mean_s = 20
sigma_s = 10
min_stay_s = 200
[[fault]]
kind = "crash"
at_s = 560.172354
target = "ER2"
restart_s = 8.559
write = 7
durable = "no"
"""


def test_a_way_given_up_while_its_rights_were_awaited_is_not_gone_when_they_come(tmp_path: Path) -> None:
    """Its plan said that it stands for eight seconds and goes the other way then, and it drove at the first grant."""
    scenario = tmp_path / "turned-away.toml"
    scenario.write_text(TURNED_AWAY, encoding="utf-8")
    log = tmp_path / "run.log"
    assert bus_sim(["run", "--scenario", str(scenario), "--trace", str(log)]) == 0
    decoder = Decoder(fleet_codec())
    with log.open("rb") as lines:
        said = [
            decoder.feed(one.frame, one.time_us)
            for one in CandumpReader(lines)
            if 1_034 <= one.time_us / 1e6 < 1_039.957
        ]
    places = {(one.track, one.index) for one in said if isinstance(one, Progress) and one.sender == MR2}
    assert places == {(3, 2)}


#: Of `bus-sim campaign standard --seeds 1-2000 --faults two-crashes --cars 8 --apart 15`, seed 9.
CUSTODIAN_WAS_OFF = """
[scenario]
site = "standard"
seed = 9
limit_s = 1200
[demand]
cars = 8
mean_s = 15
sigma_s = 7.5
min_stay_s = 200
[[fault]]
kind = "crash"
at_s = 271.378157
target = "MR1"
restart_s = 14.459
write = 5
durable = "yes"
[[fault]]
kind = "crash"
at_s = 395.171374
target = "IOC1"
restart_s = 8.794
write = 3
durable = "yes"
"""


def test_who_keeps_a_car_and_was_off_when_another_called_for_it_learns_who_fetches_it(tmp_path: Path) -> None:
    """It refused the car to the winner for ever: it knew neither the call nor the award."""
    scenario = tmp_path / "custodian.toml"
    scenario.write_text(CUSTODIAN_WAS_OFF, encoding="utf-8")
    assert bus_sim(["run", "--scenario", str(scenario), "--trace", str(tmp_path / "run.log")]) == 0


#: Of `bus-sim campaign small --exhaustive journal --scene overlap`, point 34,379.
CALLED_BEFORE_ITS_TOKEN_CAME = """
[scenario]
site = "small"
seed = 1
limit_s = 1200
[demand]
cars = 3
mean_s = 30
sigma_s = 10
min_stay_s = 60
[[fault]]
kind = "crash"
target = "MR1"
at_s = 0.0
restart_s = 5.0
write = 204
durable = "yes"
journal = "cut"
entries = 39
"""


def test_who_has_won_a_car_before_its_keeper_has_it_may_fetch_it(tmp_path: Path) -> None:
    """Its place was told at a restart, before it was handed over; its keeper forgot then who was to fetch it."""
    scenario = tmp_path / "called.toml"
    scenario.write_text(CALLED_BEFORE_ITS_TOKEN_CAME, encoding="utf-8")
    assert bus_sim(["run", "--scenario", str(scenario), "--trace", str(tmp_path / "run.log")]) == 0
