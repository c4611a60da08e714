"""Never two in one cell or one zone, no swaps; following allowed; the earliest way, against a search of its own."""

import random

import pytest

from onboard.systems.mapd import search
from onboard.systems.mapd.floor import Floor, NetworkLine, grid_floor, network_floor
from onboard.systems.mapd.paths import Path, Paths
from onboard.systems.mapd.search import find_path, is_sooner
from onboard.ways.rests import lasting_rests
from onboard.ways.steps import STEP_US, StepMoves, cell_segment

ROW = grid_floor(["....."])


def paths_of(floor: Floor, *paths: Path) -> Paths:
    found = Paths(floor.network)
    for robot, path in enumerate(paths):
        found.put(robot, path)
    return found


def may_move(floor: Floor, others: Paths, cell: int, to: int, step: int) -> bool:
    """Whether one in ``cell`` at a step may be in ``to`` a step later."""
    moves = StepMoves(floor.network, others.reservations, -1, step, others.goes_round)
    here = moves.state_at(cell_segment(cell), step * STEP_US)
    ahead = [] if here is None else moves.edges(here, step * STEP_US)
    return any(
        moves.numbered[number].segment == cell_segment(to) and first_us <= step * STEP_US < last_us
        for first_us, last_us, _, _, number, _, _ in ahead
    )


def may_rest(floor: Floor, others: Paths, cell: int, step: int) -> bool:
    """Whether one may stay in a cell for ever from a step on."""
    return find_path(floor, others, cell, step, (), frozenset([cell])) == Path(step, (cell,))


def test_a_way_that_has_become_free_is_sooner_and_a_straight_one_is_not() -> None:
    # Robot 0 let another pass in front of it on its way to cell 4, and then that one went elsewhere.
    waits, passes = Path(0, (0, 0, 0, 0, 1, 2, 3, 4)), Path(0, (2, 2, 7, 7))
    passage, ends = grid_floor([".....", "@@.@@"]), frozenset([4])
    gone = paths_of(passage, waits, passes)
    assert is_sooner(passage, gone, 0, 0, 4, ends)
    assert gone.by_robot == {0: waits, 1: passes}, "nothing is published by looking"
    assert is_sooner(passage, gone, 0, 2, 4, ends)
    assert not is_sooner(passage, gone, 0, 3, 4, ends), "from there its path is the shortest"
    stays = paths_of(passage, waits, Path(0, (2, 2, 2, 2, 2, 7)))
    assert not is_sooner(passage, stays, 0, 0, 4, ends), "who made it wait still does"


def test_who_looks_for_a_sooner_way_is_in_nobodys_way_by_its_own_path() -> None:
    # Robot 1 goes to c as robot 0 is to leave it for a: by another path it is not there, and follows robot 1 into b.
    lines = [NetworkLine(one, other, 1) for one, other in ("ab", "bc", "ca", "da", "dc")]
    floor = network_floor("abcd", lines, [])
    a, b, c, d = range(4)
    paths = paths_of(floor, Path(0, (d, c, a, b)), Path(0, (b, b, c)))
    assert is_sooner(floor, paths, 0, 0, b, frozenset([b]))


#: An open floor, one of narrow ways, and one with a zone and a way that leads in one direction only.
FLOORS = (
    grid_floor(["......", ".@..@.", "......", ".@..@."]),
    grid_floor(["......", "@@.@@.", "......", ".@@.@@"]),
    network_floor(
        "abcdef",
        [NetworkLine(a, b, 2) for a, b in ("ab", "bc", "cd", "de", "ef", "fa", "be")]
        + [NetworkLine("a", "d", 2, one_way=True)],
        [["b", "b>e"]],
    ),
)


@pytest.mark.parametrize("floor", FLOORS, ids=["open", "narrow", "network"])
def test_the_quick_look_says_no_only_where_a_search_does(floor: Floor, monkeypatch: pytest.MonkeyPatch) -> None:
    """Robots that planned around one another, some of whom have gone elsewhere since."""
    rng, found, quick = random.Random(11), 0, search._may_be_there
    cells = [cell for cell, ways in enumerate(floor.ways) if ways]
    for _ in range(150):
        paths = Paths(floor.network)
        for robot, cell in enumerate(rng.sample(cells, 5)):
            goals, ends = (rng.choice(cells),), frozenset(rng.sample(cells, 4))
            path = find_path(floor, paths, cell, 0, goals, ends)
            if path is not None:
                paths.put(robot, path)
        for gone in rng.sample(sorted(paths.by_robot), len(paths.by_robot) // 2):
            paths.take(gone)
        for robot, step in [(robot, step) for robot in sorted(paths.by_robot) for step in range(3)]:
            ask = floor, paths, robot, step, paths.by_robot[robot].rest, frozenset(cells)
            monkeypatch.setattr(search, "_may_be_there", lambda *_: True)
            is_found = is_sooner(*ask)
            monkeypatch.setattr(search, "_may_be_there", quick)
            assert is_sooner(*ask) is is_found
            found += is_found
    assert found > 20


def test_two_robots_cannot_be_in_one_cell() -> None:
    others = paths_of(ROW, Path(0, (2, 1)))
    assert not may_move(ROW, others, 0, 1, 0)
    with pytest.raises(ValueError, match="robot 1 meets robot 0 in cell 1 at step 1"):
        others.put(1, Path(0, (0, 1)))


def test_two_robots_cannot_change_places() -> None:
    others = paths_of(ROW, Path(0, (2, 1, 0)))
    assert not may_move(ROW, others, 1, 2, 0)


def test_one_may_follow_into_the_cell_that_another_leaves() -> None:
    others = paths_of(ROW, Path(0, (2, 3)))
    assert may_move(ROW, others, 1, 2, 0)
    others.put(1, Path(0, (1, 2)))


def test_a_ring_that_moves_at_once_is_not_planned_and_a_train_is() -> None:
    # Cells 0 1 over 3 4: three follow each other clockwise, and the fourth would close the ring.
    block = grid_floor(["...", "..."])
    others = paths_of(block, Path(0, (0, 1)), Path(0, (1, 4)), Path(0, (4, 3)))
    assert not may_move(block, others, 3, 0, 0)
    train = paths_of(block, Path(0, (0, 1)), Path(0, (1, 4)), Path(0, (4, 5)))
    assert may_move(block, train, 3, 0, 0)


def test_nobody_passes_one_who_stays_nor_stays_where_another_will_pass() -> None:
    others = paths_of(ROW, Path(0, (4, 3)))
    assert not may_move(ROW, others, 2, 3, 7)
    assert not may_rest(ROW, paths_of(ROW, Path(0, (0, 1, 2))), 1, 0)
    assert may_rest(ROW, paths_of(ROW, Path(0, (0, 1, 2))), 1, 2)


def test_a_path_taken_out_leaves_nothing_behind() -> None:
    others = paths_of(ROW, Path(0, (0, 1, 2)))
    others.take(0)
    assert may_rest(ROW, others, 2, 0)
    assert others.holder(1, 1) is None


def test_a_zone_takes_one_robot_at_a_time() -> None:
    floor = network_floor(["A", "B", "C"], [NetworkLine("A", "B", 3), NetworkLine("B", "C", 1)], [["A>B", "B"]])
    first = [floor.names.index(name) for name in ("A", "A>B/1", "A>B/2", "B", "C")]
    others = paths_of(floor, Path(0, tuple(first)))
    assert not may_move(floor, others, first[0], first[1], 2)
    assert may_move(floor, others, first[0], first[1], 3)


def test_a_one_way_line_is_not_passed_backwards() -> None:
    floor = network_floor(["A", "B"], [NetworkLine("A", "B", 2, one_way=True)], [])
    assert find_path(floor, Paths(floor.network), 1, 0, (0,), frozenset([0])) is None
    way = find_path(floor, Paths(floor.network), 0, 0, (1,), frozenset([1]))
    assert way is not None
    assert way.cells == (0, 2, 1)


def test_homes_that_would_shut_others_in_are_not_lasting() -> None:
    assert lasting_rests(ROW.network, [2], [0, 4]) == frozenset()
    assert lasting_rests(ROW.network, [0, 4], [1, 3]) == {0, 4}
    bay = grid_floor(["...", "@.@"])
    assert lasting_rests(bay.network, [4, 1], [0, 2]) == {4}


def earliest(floor: Floor, others: Paths, cell: int, goals: tuple[int, ...], rest: int) -> int | None:
    """The earliest arrival at the last goal, by breadth first over all (cell, goals passed) that still come to rest."""
    limit = others.horizon + 3 * floor.size
    layers: list[set[tuple[int, int]]] = [{(cell, int(cell == goals[0]))}]
    for step in range(limit):
        found = set()
        for at, leg in layers[-1]:
            for to in (*floor.ways[at], at):
                taken = others.holder(to, step + 1)
                swap = others.holder(to, step)
                swaps = swap is not None and to != at and others.holder(at, step + 1) == swap
                if taken is None and not swaps:
                    found.add((to, leg + 1 if leg < len(goals) and goals[leg] == to else leg))
        layers.append(found)
    # Backwards: from which states can one still come to rest?
    good = {state for state in layers[limit] if state == (rest, len(goals))}
    best = None
    for step in range(limit, -1, -1):
        if any(state[1] == len(goals) for state in good):
            best = step
        if step == 0:
            break
        before = set()
        for at, leg in layers[step - 1]:
            for to in (*floor.ways[at], at):
                after = (to, leg + 1 if leg < len(goals) and goals[leg] == to else leg)
                taken, swap = others.holder(to, step), others.holder(to, step - 1)
                swaps = swap is not None and to != at and others.holder(at, step) == swap
                if after in good and taken is None and not swaps:
                    before.add((at, leg))
        good = before
    return best


def test_p59_the_search_is_as_early_as_an_exhaustive_one() -> None:
    rng = random.Random(5)
    compared = 0
    for _ in range(60):
        rows = ["".join("." if rng.random() < 0.8 else "@" for _ in range(4)) for _ in range(4)]
        floor = grid_floor(rows)
        free = [cell for cell in range(16) if rows[cell // 4][cell % 4] == "."]
        if len(free) < 6:
            continue
        others = Paths(floor.network)
        for robot in range(2):
            walk = [rng.choice(free)]
            for _ in range(6):
                walk.append(rng.choice([*floor.ways[walk[-1]], walk[-1]]))
            try:
                others.put(robot, Path(0, tuple(walk)))
            except ValueError:
                continue
        start, first, second, rest = rng.sample(free, 4)
        if others.holder(start, 0) is not None:
            continue
        path = find_path(floor, others, start, 0, (first, second), frozenset([rest]))
        wanted = earliest(floor, others, start, (first, second), rest)
        if path is None:
            assert wanted is None or others.holder(rest, wanted + 50) is not None
            continue
        picked = next(step for step, cell in path.steps() if cell == first)
        assert next(step for step, cell in path.steps() if cell == second and step >= picked) == wanted
        others.put(9, path)
        compared += 1
    assert compared >= 15


def test_steps_are_those_of_the_free_floor() -> None:
    floor = grid_floor(["..@", "@..", "..."])
    assert floor.steps_to(0)[8] == 4
    assert floor.steps_to(0)[2] > 1000
