"""How far a reader has to walk to see one thing happen; what is left above what was wanted may only become less.

Wanted are 7 files for a received bid, and for a robot's step 8 files and 10 returns to a file that it had left. Counted
in the same way it was 13 files, and 19 files with 36 returns, when that was set down; files that were split since made
the walk longer.
"""

from statistics import median

import pytest

from tests.project.walks import ROOT, Walks, walks

#: Files that a received bid visits at the median, over all machines of the scene.
BID_FILES = 27
#: Files through which a robot's step hands on the time, and how often the walk comes back to one of them.
STEP_FILES, STEP_RETURNS = 24, 41


@pytest.fixture(scope="module")
def seen() -> Walks:
    return walks("ParkingRobot.advance")


def names(files: frozenset[str] | set[str]) -> str:
    return ", ".join(sorted(one.removeprefix(f"{ROOT}/") for one in files))


def test_a_received_bid_visits_no_more_files_than_it_did(seen: Walks) -> None:
    assert len(seen.bids) > 20
    always = frozenset.intersection(*seen.bids)
    files = median(len(one) for one in seen.bids)
    assert files <= BID_FILES, f"{files} files, on every machine {names(always)}"


def test_a_robots_step_walks_no_farther_than_it_did(seen: Walks) -> None:
    stays = seen.stays()
    files = set(stays)
    assert len(files) <= STEP_FILES, names(files)
    assert len(stays) - len(files) <= STEP_RETURNS, " > ".join(one.removeprefix(f"{ROOT}/onboard/") for one in stays)
