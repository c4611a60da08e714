"""Who has to be late says so while others can still plan around it."""

from bus_sim.can.faults import FaultKind, InjectedFault
from bus_sim.sites import find_site
from onboard.contract.messages import Itinerary, Progress, TaskReport
from tests.system.scene import Scene, play, stays

IOC1, MR1 = 1, 11
SENDER_MASK = 0xFF
SECOND = 1_000_000


def without_words_of_the_compartment(from_us: int, until_us: int) -> Scene:
    lost = InjectedFault(
        FaultKind.OMISSION,
        receivers=("MR1",),
        id_value=IOC1,
        id_mask=SENDER_MASK,
        extended=True,
        from_us=from_us,
        until_us=until_us,
    )
    return play(find_site("small"), stays((10, None)), faults=(lost,))


def test_a_run_that_waits_for_rights_is_told_late_as_soon_as_that_is_certain() -> None:
    """It was told once the whole run should have been over, and others planned through where it stood.

    `standard`, two crashes, seeds 6008, 6013 and 6180.
    """
    undisturbed = play(find_site("small"), stays((10, None)))
    begun_us, _ = undisturbed.first(Progress, lambda one: one.sender == MR1 and one.track == 1)
    worked_us, _ = undisturbed.first(TaskReport, lambda one: one.sender == MR1, begun_us)
    assert worked_us - begun_us > 10 * SECOND
    late = without_words_of_the_compartment(begun_us - SECOND, begun_us + 4 * SECOND)
    told_us, _ = late.first(Itinerary, lambda one: one.sender == MR1, begun_us)
    assert told_us - begun_us < 3 * SECOND
    late.assert_sound()
