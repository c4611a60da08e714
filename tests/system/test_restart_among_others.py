"""A robot that is started again while the others plan, bid and drive goes on from where it is, and wrongs nobody."""

from collections import Counter
from pathlib import Path
from typing import NamedTuple

import pytest

from bus_sim import sites
from bus_sim.campaign.report import RunVerdict
from bus_sim.cli import main as bus_sim
from bus_sim.systems.car_park.demand import Arrivals
from bus_sim.systems.car_park.plant.customer import TABLE, CustomerEvent, CustomerState
from onboard.cli import main as onboard
from onboard.contract.messages import Progress
from onboard.trace.candump_reader import CandumpReader
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder
from tests.system.scenarios import played

MR2 = 12
#: While MR2's plan says that it stands, s.
FROM_S, TO_S = 1_034, 1_039.957
SITE = Path(sites.__file__).parent / "small.toml"
RUN = "run small --random 40 15 --cars 5 --seed 77 --speed max --no-web --devices"
CRASH = "crash:target=MR1,at_s=80,restart_s=5"
#: Dense cars, as the campaigns of two crashes a seed have them.
DENSE = {"small": Arrivals(6, 20, 10, 200), "standard": Arrivals(8, 15, 7.5, 200)}


class Found(NamedTuple):
    """A seed of which not everybody was served in time: what is right, and what was wrong."""

    right: str
    wrong: str
    site: str
    seed: int
    crashes: tuple[str, ...]


#: What campaigns found and was mended, with the crashes that it takes.
FOUND = (
    Found(
        "who keeps a car and was off when another called for it learns who fetches it",
        "It refused the car to the winner for ever: it knew neither the call nor the award.",
        "standard",
        9,
        (
            "crash:at_s=271.378157,target=MR1,restart_s=14.459,write=5,durable=yes",
            "crash:at_s=395.171374,target=IOC1,restart_s=8.794,write=3,durable=yes",
        ),
    ),
    Found(
        "a car that nobody came to park is its drivers who comes back with the ticket",
        "It was told to be outside while it stood in the only bay, and nobody was served any more.",
        "small",
        414,
        ("crash:at_s=610.960052,target=MR1,restart_s=18.542,write=6,durable=yes",),
    ),
    Found(
        "who was off while its task was called anew does not begin it",
        "Nobody had it at that moment, so it was not told that it had lost it, and went for the car.",
        "small",
        2169,
        (
            "crash:at_s=333.410943,target=MR1,restart_s=15.574,write=1,durable=yes",
            "crash:at_s=375.432383,target=MR2,restart_s=13.868,write=1,durable=no",
        ),
    ),
    Found(
        "who stands face to face turns though the other has rights behind it",
        "Each had been granted slots beyond the other, took them for blocked, and found no way for ten minutes.",
        "standard",
        4017,
        ("crash:at_s=450.741843,target=MR3,restart_s=7.641,write=6,durable=no",),
    ),
    Found(
        "a lift goes though its gate was granted for a boarding that was given up",
        "It took the robot aboard for one that had not come in yet, gave the gate back to it, and both waited.",
        "standard",
        5081,
        ("crash:at_s=46.577741,target=MR3,restart_s=1.093,write=4,durable=no",),
    ),
    Found(
        "who fetched a car before is not taken for the winner of its next task",
        "Its compartment lost its power before anybody had won the new task, and waited for the winner of the old one.",
        "standard",
        5126,
        ("crash:at_s=304.772808,target=IOC3,restart_s=5.548,frame=56",),
    ),
    Found(
        "who stands though it should drive is known to be late before its run should be over",
        "The steward of their slots was off; another planned right through where it stood, and neither could go on.",
        "standard",
        6180,
        ("crash:at_s=226.064149,target=IOC3,restart_s=19.376,frame=42",),
    ),
    Found(
        "a run planned long after its award is not taken for one that began then",
        "By its award it was first on all slots ahead, was granted them, and stood behind who should have gone first.",
        "standard",
        6124,
        ("crash:at_s=391.601428,target=MR1,restart_s=19.983",),
    ),
    Found(
        "who wins one more task keeps its place in the order on the way that it goes already",
        "It was behind another that was late, and first on the same slots with the new task's plan.",
        "standard",
        6137,
        ("crash:at_s=479.350538,target=IOC1,restart_s=10.364,write=2,durable=no",),
    ),
    Found(
        "a lift lets in by a gate that came back from the ride before only then",
        "It was started again while its robot gave platform and gate back, and the platform came first.",
        "small",
        6254,
        ("crash:at_s=333.643285,target=ER1,restart_s=14.199,write=7,durable=yes",),
    ),
    Found(
        "a winner that is not noted yet is believed when all are asked",
        "The power failed between the award and its record; the task was called anew, and awarded to a second robot.",
        "small",
        4315,
        ("crash:at_s=213.74776,target=IOC1,restart_s=14.953,write=8,durable=no",),
    ),
    Found(
        "who works where another was to come first does not plan to work there until that one has been",
        "The other then planned to wait for it, for 154 s, aboard a lift, and nobody moved although it left after six.",
        "small",
        135,
        ("crash:at_s=117.016517,target=MR1,restart_s=17.716,write=1,durable=no",),
    ),
    Found(
        "who stands by a plan around an obstacle sets off when that is gone",
        "A lift was off for 17 s; the robot kept to a wait of 90 s for another that had given its task back by then.",
        "small",
        9476,
        (
            "crash:at_s=125.343839,target=IOC1,restart_s=7.703",
            "crash:at_s=573.229038,target=ER1,restart_s=17.726,frame=52",
        ),
    ),
)


@pytest.mark.parametrize("found", FOUND, ids=lambda found: f"{found.site}-{found.seed} {found.right}")
def test_what_two_crashes_a_seed_found_is_served_in_time(found: Found) -> None:
    report = played(found.site, found.seed, DENSE[found.site], *found.crashes, limit_s=3_600)
    assert report.verdict is RunVerdict.SERVED, f"{found.wrong} {report.why()}"


def test_a_plan_heard_while_a_robot_recovers_does_not_move_it(tmp_path: Path) -> None:
    """It planned from the end of a way not driven, with its shuttle out, and woke for ever at one moment."""
    log = tmp_path / "run.log"
    assert bus_sim([*RUN.split(), "--fault", CRASH, "--trace", str(log)]) == 0
    assert onboard(["trace", "check", str(log), "--site", str(SITE)]) == 0


def test_a_way_given_up_while_its_rights_were_awaited_is_not_gone_when_they_come(tmp_path: Path) -> None:
    """Its plan said that it stands for eight seconds and goes the other way then, and it drove at the first grant.

    Two crashes a seed on `small`, seed 35.
    """
    log = tmp_path / "run.log"
    crash = "crash:at_s=560.172354,target=ER2,restart_s=8.559,write=7,durable=no"
    report = played("small", 35, Arrivals(6, 20, 10, 200), crash, trace=log)
    assert report.verdict is RunVerdict.SERVED, report.why()
    decoder = Decoder(fleet_codec())
    with log.open("rb") as lines:
        said = [
            decoder.feed(one.frame, one.time_us) for one in CandumpReader(lines) if FROM_S <= one.time_us / 1e6 < TO_S
        ]
    places = {(one.track, one.index) for one in said if isinstance(one, Progress) and one.sender == MR2}
    assert places <= {(3, 2)}


def test_who_has_won_a_car_before_its_keeper_has_it_may_fetch_it() -> None:
    """Its place was told at a restart, before it was handed over; its keeper forgot then who was to fetch it.

    Harm to a journal on `small` with three cars that overlap, point 34,379.
    """
    crash = "crash:target=MR1,at_s=0,restart_s=5,write=204,durable=yes,journal=cut,entries=39"
    report = played("small", 1, Arrivals(3, 30, 10, 60), crash)
    assert report.verdict is RunVerdict.SERVED, report.why()


def test_a_car_that_nobody_came_to_park_is_called_for_again_where_its_driver_has_gone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The only robot is off for two minutes, and whoever has a ticket does not look at the desk any more."""
    monkeypatch.delitem(TABLE, (CustomerState.PARKED, CustomerEvent.FULL))
    report = played("level1", 1, Arrivals(2, 20, 10, 300), "crash:target=MR1,at_s=8,restart_s=120")
    assert report.verdict is RunVerdict.SERVED, report.why()


def test_two_plans_that_cannot_change_where_they_meet_do_not_answer_each_other_without_end(tmp_path: Path) -> None:
    """One was aboard a lift, the other about to go to it: each turned for slots of the other, and told the same plan.

    The bus was full for nine seconds; delay upon delay, one then planned for five hours later.
    Two crashes a seed on `standard`, seed 5019.
    """
    first = "crash:at_s=67.514212,target=MR3,restart_s=18.479,write=3,durable=no"
    second = "crash:at_s=232.339681,target=MR1,restart_s=3.692,frame=49"
    log = tmp_path / "run.log"
    report = played("standard", 5019, Arrivals(8, 15, 7.5, 200), first, second, limit_s=3_600, trace=log)
    assert report.verdict is RunVerdict.SERVED, report.why()
    seconds = Counter(line.partition(".")[0] for line in log.read_text().splitlines())
    assert max(seconds.values()) < 400
