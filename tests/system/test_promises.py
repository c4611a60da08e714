"""What a robot bid for behind another bid is no plan of its own: it follows on what was won, or is given back."""

from pathlib import Path

from bus_sim.campaign.points import SceneOccasion, reference
from bus_sim.campaign.trial import play
from bus_sim.faults.injection import Injection
from bus_sim.sites import find_site


def test_a_second_task_does_not_put_the_first_out_of_the_plan_where_both_are_too_long_to_be_told(
    tmp_path: Path,
) -> None:
    """On the ring a way has some twenty-five legs, an itinerary thirty-one; the other robot is off.

    It drove on from where the first task would have ended, ordering turns that its drive refused, without an end.
    """
    scene = reference("ring", 193.0, SceneOccasion.OVERLAP)
    crash = Injection("crash", {"target": "MR1", "at_s": 0.0, "restart_s": 9.0, "frame": 708})
    log = tmp_path / "ring.log"
    report = play(find_site("ring"), scene.with_faults((crash,)), trace=log)
    assert not report.violations
    assert len(log.read_bytes().splitlines()) < 3_500
