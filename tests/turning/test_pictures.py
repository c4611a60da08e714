"""The turning cell on the page and over time: what is drawn is what machines and bodies say."""

from itertools import pairwise

from bus_sim.sites import find_site
from onboard.contract.turning import LathePhase, LatheProgress
from onboard.contract.turning_device import NcState
from onboard.systems.turning.diagram import TurningDiagram
from onboard.systems.turning.site import Turning
from tests.web.logs import film_of, said_in
from tests.web.pictures import last, moments, watched


def test_lathes_are_at_one_order_at_a_time_as_they_say() -> None:
    site = find_site("turning")
    assert isinstance(site, Turning)
    panel = watched(TurningDiagram(site, None, None), "turning").panels[0]
    for node in site.lathes:
        bars = sorted((bar.begin_us, bar.end_us) for bar in panel.bars if bar.node == node)
        assert all(one[1] <= two[0] for one, two in pairwise(bars))
    turning = [(us, one) for us, _, one in said_in("turning") if isinstance(one, LatheProgress)]
    assert any(one.lathe_phase is LathePhase.TURNING for _, one in turning)
    for time_us, one in turning:
        if one.lathe_phase in (LathePhase.SETTING_UP, LathePhase.TURNING):
            words = f"order {one.task}, "
            at = [bar for bar in panel.bars if bar.node == one.sender and bar.begin_us <= time_us <= bar.end_us]
            assert any(bar.text.startswith(words) for bar in at)


def test_lathes_have_made_what_their_controls_count() -> None:
    said = said_in("turning")
    with film_of("turning", fleet_only=True) as film:
        for time_us, snapshot in moments(film, 20_000_000):
            for node in (1, 2, 3):
                words, control = snapshot["machines"][node]["where"], last(said, NcState, node, time_us)
                if words.startswith("turning"):
                    assert control.parts == int(words.split()[1])
