"""The factory graph on the page and over time: what is drawn is what machines and bodies say."""

from bus_sim.sites import find_site
from onboard.contract.graph import BodyPlace, RobotAt
from onboard.contract.graph_device import BodyState
from onboard.systems.graph.diagram import GraphDiagram
from onboard.systems.graph.site import FactoryGraph
from tests.web.logs import film_of, said_in
from tests.web.pictures import at, last, moments, points_of, watched


def test_robots_of_a_graph_are_in_the_rows_of_their_nodes() -> None:
    site = find_site("graph")
    assert isinstance(site, FactoryGraph)
    diagram = watched(GraphDiagram(site, None, None), "graph")
    rows = list(diagram.panels[0].rows)
    arrived = [(us, one) for us, _, one in said_in("graph") if isinstance(one, RobotAt) and not one.on_edge]
    assert len({one.node for _, one in arrived}) > 4
    for time_us, one in arrived:
        assert (time_us, rows.index(f"N{one.node}")) in points_of(diagram, one.sender)


def test_robots_of_a_graph_are_where_their_bodies_say_and_alone_on_their_edges() -> None:
    said = said_in("graph")
    with film_of("graph", fleet_only=True) as film:
        layout = film.show(film.first_us).layout()
        spots = {one["name"]: one["points"][0] for one in layout["plan"]["shapes"] if one["kind"] == "node"}
        for time_us, snapshot in moments(film, 2_000_000):
            held = [edge for one in snapshot["machines"].values() for edge, _ in one.get("held", [])]
            assert len(held) == len(set(held)), "an edge is one robot's"
            for node in (11, 12, 13):
                body, told = last(said, BodyState, node, time_us), snapshot["machines"][node]
                if body is None:
                    continue
                x, y = at(told["path"], time_us)
                if body.body_place is BodyPlace.IN_NODE:
                    assert told["where"].startswith(f"N{body.node}")
                    assert abs(x - spots[f"N{body.node}"][0]) <= 40 and y == spots[f"N{body.node}"][1]
                else:
                    assert told["where"].startswith(f"N{body.behind} to N{body.node}")
                    low, high = sorted((spots[f"N{body.behind}"][0], spots[f"N{body.node}"][0]))
                    assert low <= x <= high
