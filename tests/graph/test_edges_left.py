"""One robot an edge, by their own words: who gives the right to an edge away has left it."""

from bus_sim.sites import find_site
from onboard.contract.codes import TokenKind
from onboard.contract.graph import RobotAt, RobotMode
from onboard.contract.messages import TokenGrant
from onboard.systems.graph.rights import edge_token
from tests.trace.checking import Tape

KEEPER, FIRST, SECOND = 1, 11, 12


def on_edge(robot: int, behind: int = 0, node: int = 1) -> RobotAt:
    return RobotAt(robot, behind, node, True, RobotMode.DRIVING, 255, 255, 255, node)


def given(one: int, other: int) -> TokenGrant:
    return TokenGrant(FIRST, TokenKind.SEGMENT, edge_token(one, other).number, 3, KEEPER)


def found(*words: RobotAt | TokenGrant) -> int:
    tape = Tape(find_site("graph"), started=False, disturbed=True)
    return tape.say(1, on_edge(FIRST), *words).broken().get("one-an-edge", 0)


def test_who_crashed_before_it_said_where_it_came_to_is_not_on_the_edge_it_gave_away() -> None:
    """A drawn graph, 843, operators."""
    assert found(given(0, 1), on_edge(SECOND)) == 0
    assert found(on_edge(SECOND)) == 1
    assert found(given(1, 2), on_edge(SECOND)) == 1


def test_who_says_that_it_is_still_on_an_edge_that_it_gave_away_is_found() -> None:
    assert found(given(0, 1), on_edge(SECOND), on_edge(FIRST)) == 1
