"""The container terminal on the page and over time: what is drawn is what machines and bodies say."""

from bus_sim.sites import find_site
from onboard.contract.terminal import LaneState, StepReport, StepResult
from onboard.contract.terminal_device import MoveState
from onboard.systems.terminal.diagram import TerminalDiagram
from onboard.systems.terminal.site import EntityKind, Terminal
from tests.web.logs import film_of, said_in
from tests.web.pictures import Snapshot, last, moments, watched


def test_vehicles_of_a_terminal_pass_lanes_from_end_to_end_while_they_hold_them() -> None:
    site = find_site("terminal")
    assert isinstance(site, Terminal)
    panel = watched(TerminalDiagram(site, None, None), "terminal").panels[0]
    lanes = [line for line in panel.lines if line.points[0][1] != line.points[1][1]]
    done = {
        (one.sender, one.at_ms)
        for _, _, one in said_in("terminal")
        if isinstance(one, StepReport)
        and one.result is StepResult.DONE
        and site.entities[one.entity].kind is EntityKind.LANE
    }
    assert len(lanes) == len(done)
    for line in lanes:
        (begin_us, begin), (end_us, end) = line.points
        held = [bar for bar in panel.bars if bar.node == line.node and begin <= (bar.low + bar.high) / 2 <= end]
        assert any(bar.begin_us <= begin_us <= bar.end_us for bar in held)
        assert any(bar.begin_us <= end_us <= bar.end_us for bar in held)
    blocked = [bar for bar in panel.bars if not bar.node]
    told = [us for us, _, one in said_in("terminal") if isinstance(one, LaneState) and one.blocked]
    assert [bar.begin_us for bar in blocked] == [min(told)]


def test_vehicles_of_a_terminal_are_where_their_drives_say() -> None:
    """Their plans and reports alone tell it, but for the moment between a movement and its report."""
    site, said, right, wrong = find_site("terminal"), said_in("terminal"), 0, 0
    assert isinstance(site, Terminal)
    with film_of("terminal", fleet_only=True) as film:
        for time_us, snapshot in moments(film, 5_000_000):
            for node in site.vehicles:
                state = last(said, MoveState, node, time_us)
                if state is None:
                    continue
                shown = site.by_name[snapshot["machines"][node]["where"].partition(",")[0]]
                there = site.entities[state.entity]
                # A drive knows areas, not the stations in them.
                is_right = there.number in (shown.number, shown.area)
                right, wrong = right + is_right, wrong + (not is_right)
    assert right > 100 and wrong <= right // 100


def test_boxes_of_a_terminal_end_where_its_missions_want_them() -> None:
    site = find_site("terminal")
    assert isinstance(site, Terminal)
    with film_of("terminal", fleet_only=True) as film:
        first, end = film.show(film.first_us).snapshot(), film.show(film.last_us).snapshot()
    names = {str(one.number): one.name for one in site.entities.values() if one.kind is EntityKind.STATION}

    def counts(snapshot: Snapshot) -> dict[str, int]:
        return {name: snapshot["marks"][number]["count"] for number, name in names.items()}

    assert counts(first) == {"S2": 4, "S3": 3, "S5": 4, "S1": 0, "S4": 0, "S10": 0}
    stands = counts(end)
    # Four of type T1 to S10, B11 to B13 to S4, B14 to S1 (bus_sim/sites/terminal.toml).
    assert (stands["S10"], stands["S4"], stands["S1"], stands["S5"]) == (4, 3, 1, 0)
    assert end["figures"]["done"] == 8 and end["tasks"] == []


def test_a_blocked_lane_is_marked_as_long_as_its_desk_says_so() -> None:
    site = find_site("terminal")
    assert isinstance(site, Terminal)
    (blockage,) = site.blockages
    with film_of("terminal", fleet_only=True) as film:
        for time_us, snapshot in moments(film, 10_000_000):
            marked = str(blockage.lane) in snapshot["marks"]
            if min(abs(time_us - blockage.at_us), abs(time_us - blockage.until_us)) > 1_000_000:
                assert marked is (blockage.at_us < time_us < blockage.until_us)
