"""Plans of the systems that are no car park: what is drawn from the fleet bus is what the bodies themselves say."""

import json

import pytest

from onboard.contract.codes import TaskPhase
from onboard.contract.messages import TaskReport
from onboard.trace.scene.arrange import arrange
from onboard.trace.scene.scene import along, part, spot_on
from tests.web.logs import film_of, said_in
from tests.web.pictures import at


@pytest.mark.parametrize("name", ["terminal", "graph", "cell", "turning"])
def test_tasks_shown_as_done_are_those_that_were_reported(name: str) -> None:
    done = {
        one.task
        for _, is_fleet, one in said_in(name)
        if is_fleet and isinstance(one, TaskReport) and one.phase is TaskPhase.DONE
    }
    with film_of(name) as film:
        picture = film.show(film.last_us)
        snapshot = json.loads(json.dumps(picture.snapshot()))
    assert snapshot["figures"]["done"] == len(done)
    assert not {one["task"] for one in snapshot["tasks"]} & {picture.view.words.reference(task) for task in done}


def test_a_network_is_arranged_by_its_lengths_and_always_the_same() -> None:
    ring = {(number, (number + 1) % 6): 1.0 for number in range(6)}
    spots = arrange(ring, list(range(6)), 100)
    assert spots == arrange(ring, list(range(6)), 100)
    sides = [((spots[one][0] - spots[two][0]) ** 2 + (spots[one][1] - spots[two][1]) ** 2) ** 0.5 for one, two in ring]
    assert min(sides) == pytest.approx(100) and max(sides) < 115
    apart = arrange({(1, 2): 1.0, (3, 4): 1.0}, [1, 2, 3, 4], 50)
    assert len(set(apart.values())) == 4, "what no way joins is drawn all the same"
    assert arrange({}, [7], 50) == {7: (0.0, 0.0)}


def test_a_machine_goes_evenly_along_its_line_and_never_beyond_it() -> None:
    corner = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0)]
    assert spot_on(corner, 0.75) == (10.0, 5.0) and part(corner, 0.25, 1.0)[0] == (5.0, 0.0)
    path = along(corner, 1_000, 3_000)
    assert [at(path, time_us) for time_us in (0, 1_000, 2_000, 2_500, 9_000)] == [
        (0, 0),
        (0, 0),
        (10, 0),
        (10, 5),
        (10, 10),
    ]
    assert at(along(corner, 0, 1_000, 0.5), 5_000) == (10, 0)
