"""The site file of a graph: what it says, and one line for each mistake."""

import pytest

from bus_sim.sites import find_site
from onboard.config.problems import ConfigError
from onboard.config.site import parse_site
from onboard.systems.graph.rules import Rules
from onboard.systems.graph.site import FactoryGraph
from tests.graph.sites import hall, site_text

GOOD = site_text(hall(), (0, 8), [(0, "any", (1, 2)), (5, "R1", (3, 4, 5))], Rules.KEEP, capacity=3)


def test_the_shipped_graph() -> None:
    site = find_site("graph")
    assert isinstance(site, FactoryGraph)
    assert len(site.graph.nodes) == 8 and len(site.edges) == 12 and len(site.robots) == 3
    assert site.graph.dead_ends == ()
    assert site.rules is Rules.EDGE_AND_NODE and site.capacity >= len(site.robots)


def test_a_graph_is_read_as_it_is_written() -> None:
    site = parse_site(GOOD, "g.toml")
    assert isinstance(site, FactoryGraph)
    assert site.rules is Rules.KEEP and site.capacity == 3 and site.load_ms == 2000
    assert site.hosts[4] == 1 and site.hosts[5] == 2
    assert [(order.at_ms, order.robot, order.stops) for order in site.orders] == [(0, 0, (1, 2)), (5000, 21, (3, 4, 5))]
    # Row G27: another length is another map.
    assert parse_site(GOOD.replace("[0, 1, 6000]", "[0, 1, 6001]"), "g.toml").digest != site.digest


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[0, 1, 6000]", "[0, 0, 6000]", ("from a node to itself", "join two different nodes")),
        ("[0, 1, 6000]", "[0, 3, 6000]", ("joined already", "write each edge once")),
        ("[0, 1, 6000]", '[0, "1", 6000]', ("not an edge", "nodes 0 to 254")),
        ("[0, 1, 6000]", "[0, 255, 6000]", ("not an edge", "nodes 0 to 254")),
        ("[0, 1, 6000], ", "", ("a node with one edge", "none comes out")),
        ("[0, 1, 6000]", "[0, 1, 6000], [20, 21, 900], [21, 22, 900], [20, 22, 900]", ("cannot be reached", "join")),
        ('rules = "keep"', 'rules = "kept"', ("unknown word", "keep")),
        ("capacity = 3", "capacity = 0", ("out of range", "1 to 15")),
        ("load_ms = 2000", "load_ms = 2000\napproach_mm = 7000", ("not shorter", "nearer to the node")),
        ("nodes = [0, 2, 4, 6, 8]", "nodes = [0, 2, 4, 6, 80]", ("no node of the graph", "nodes of this graph")),
        ("nodes = [0, 2, 4, 6, 8]", "nodes = [0, 2, 4, 6, 7, 8]", ("hosted already", "one host")),
        ("nodes = [0, 2, 4, 6, 8]", "nodes = [0, 2, 4, 6]", ("without host", "[[hosts]]")),
        ("at = 8", "at = 9", ("no node of the graph", "nodes of this graph")),
        ('robot = "R1"', 'robot = "R7"', ("no robot of this name", '"any"')),
        ("visit = [3, 4, 5]", "visit = [3, 4, 4]", ("a stop twice", "no two alike")),
        ("visit = [3, 4, 5]", "visit = [3, 4, 50]", ("no node of the graph", "nodes of this graph")),
        ("visit = [3, 4, 5]", "visit = []", ("not a list of stops", "1 to 5 nodes")),
        ("visit = [1, 2]", "visit = [1, 2, 3]", ("not from where and to where", "two stops")),
        ("at_s = 5", "at_s = 5\nspeed = 3", ("unknown key", "")),
    ],
)
def test_each_mistake_is_one_line_with_file_place_and_remedy(old: str, new: str, words: tuple[str, ...]) -> None:
    assert GOOD.count(old) >= 1
    with pytest.raises(ConfigError) as caught:
        parse_site(GOOD.replace(old, new, 1), "g.toml")
    text = str(caught.value)
    line = next(line for line in text.splitlines() if words[0] in line)
    assert line.startswith("g.toml:") and all(word in line for word in words), text
