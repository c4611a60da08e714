"""The manufacturing cell on the page and over time: what is drawn is what machines and bodies say."""

from statistics import median

from bus_sim.sites import find_site
from onboard.contract.cell import ArmPhase, ArmProgress, PartAt
from onboard.contract.cell_device import ArmState
from onboard.systems.cell.diagram import CellDiagram
from onboard.systems.cell.site import Cell
from tests.web.logs import film_of, said_in
from tests.web.pictures import at, last, moments, watched


def test_arms_carry_where_they_say_and_parts_go_from_arm_to_arm() -> None:
    site = find_site("cell")
    assert isinstance(site, Cell)
    panel = watched(CellDiagram(site, None, None), "cell").panels[0]
    carrying = [(us, one) for us, _, one in said_in("cell") if isinstance(one, ArmProgress)]
    for time_us, one in carrying:
        bars = [bar for bar in panel.bars if bar.node == one.sender and bar.begin_us <= time_us < bar.end_us]
        if one.arm_phase is ArmPhase.CARRYING:
            assert [bar.text.split()[0] for bar in bars] == ["part"]
        elif one.arm_phase in (ArmPhase.IDLE, ArmPhase.WAITING):
            assert not bars
    assert max(len({row for _, row in line.points}) for line in panel.lines) > 2


def test_robots_of_a_cell_are_drawn_where_their_drives_are() -> None:
    """They tell their places every two seconds on the way and go 1 m/s: no more than that apart, mostly nothing."""
    site, said, gaps_mm = find_site("cell"), said_in("cell"), []
    with film_of("cell", fleet_only=True) as film:
        layout = film.show(film.first_us).layout()
        (left, top), (right, _) = next(one["points"] for one in layout["plan"]["shapes"] if one["id"] == "a1")
        area = vars(site)["arms"][1].area
        unit = (area.x1_mm - area.x0_mm) / (right - left)
        for time_us, snapshot in moments(film, 1_000_000):
            for node in range(1, 6):
                state = last(said, ArmState, node, time_us)
                if state is not None:
                    x, y = at(snapshot["machines"][node]["path"], time_us)
                    x_mm, y_mm = area.x0_mm + (x - left) * unit, area.y1_mm - (y - top) * unit
                    gaps_mm.append(((x_mm - state.x_mm) ** 2 + (y_mm - state.y_mm) ** 2) ** 0.5)
    assert median(gaps_mm) < 60 and max(gaps_mm) < 3_000


def test_parts_of_a_cell_lie_where_their_custodians_say() -> None:
    said = said_in("cell")
    with film_of("cell", fleet_only=True) as film:
        for time_us, snapshot in moments(film, 5_000_000):
            told: dict[int, PartAt] = {}
            for at_us, _, one in said:
                if at_us <= time_us and isinstance(one, PartAt):
                    told[one.part.number] = one
            lying = {str(number) for number, one in told.items() if not one.aboard}
            assert {one["name"] for one in snapshot["things"] if one["kind"] == "part"} == lying
            aboard = {one.sender: str(number) for number, one in told.items() if one.aboard}
            assert {node: one["car"] for node, one in snapshot["machines"].items() if one["car"]} == aboard
