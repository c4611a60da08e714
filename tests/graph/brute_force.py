"""A search of its own for timings that stick: other states, other routes, other order; shares no code with the product.

A robot is its whole remaining list of nodes; ways come from enumerating all ways by length. Slow and plain on purpose.
"""

from collections.abc import Iterator, Mapping

Way = tuple[int, ...]
Edges = frozenset[frozenset[int]]
#: A node, and the edge that it keeps.
Kept = frozenset[tuple[int, frozenset[int]]]


def shortest(edges: Edges, start: Way, goal: int) -> Way | None:
    """The shortest way that continues ``start`` without turning back, lowest nodes first; None where there is none."""
    frontier = [start]
    for _ in range(2 * len(edges) + 1):
        done = sorted(way for way in frontier if way[-1] == goal)
        if done:
            return done[0]
        grown: dict[tuple[int, int], Way] = {}
        for way in sorted(frontier):
            for one in edges:
                if way[-1] in one:
                    (after,) = one - {way[-1]}
                    if len(way) < 2 or after != way[-2]:
                        grown.setdefault((way[-1], after), (*way, after))
        frontier = list(grown.values())
    return None


def can_stick(edges: Edges, starts: Way, goals: Way, *, rule: str) -> bool:
    """Depth-first over robots' remaining ways: (behind or -1, node, ..., goal); an empty way has arrived.

    ``rule``: "paper", "keep", or "keep-on-notice", for which each state also has who keeps which edge.
    """
    first = []
    for start, goal in zip(starts, goals, strict=True):
        way = shortest(edges, (start,), goal)
        assert way is not None
        first.append((-1, *way))
    seen = set()
    stack: list[tuple[tuple[Way, ...], Kept]] = [(tuple(first), frozenset())]
    while stack:
        ways, kept = stack.pop()
        if (ways, kept) in seen:
            continue
        seen.add((ways, kept))
        after = list(_after(edges, ways, kept, rule=rule))
        if not after and any(ways):
            return True
        stack += after
    return False


def _after(edges: Edges, ways: tuple[Way, ...], kept: Kept, *, rule: str) -> Iterator[tuple[tuple[Way, ...], Kept]]:
    taken = {frozenset(way[:2]) for way in ways if way and way[0] >= 0}

    def grants(node: int, after: int) -> bool:
        if frozenset((node, after)) in taken or (after, frozenset((node, after))) in kept:
            return False
        mine = [one for one in edges if after in one]
        left = [one for one in mine if one not in taken]
        return not (rule == "keep" and len(left) == 1 and len(mine) > 1)

    for number, way in enumerate(ways):
        if not way:
            continue
        for new in _steps(edges, ways, way, grants):
            following = (*ways[:number], new, *ways[number + 1 :])
            yield following, _noticed(edges, way, new, following, kept) if rule == "keep-on-notice" else kept


def _noticed(edges: Edges, way: Way, new: Way, ways: tuple[Way, ...], kept: Kept) -> Kept:
    """The far end of the edge that is entered counts its free ones; the far end of the one left lets its own go."""
    now = set(kept)
    if new:
        node, far = new[:2]
        now -= {(node, frozenset((node, far)))}
        busy = {frozenset(one[:2]) for one in ways if one and one[0] >= 0} | {one for _, one in now}
        mine = [one for one in edges if far in one]
        left = [one for one in mine if one not in busy]
        if len(left) == 1 < len(mine):
            now.add((far, left[0]))
    return frozenset(one for one in now if one[0] != way[0])


def _steps(edges: Edges, ways: tuple[Way, ...], way: Way, grants: object) -> Iterator[Way]:
    assert callable(grants)
    if len(way) == 2:
        yield ()
        return
    behind, node, wants = way[:3]
    if grants(node, wants):
        yield way[1:]
        return
    opposite = [one for one in ways if one[:2] == (wants, node) and one[2:3] == (behind,)]
    if behind < 0 or not opposite:
        return
    for one in edges:
        if node in one:
            (after,) = one - {node}
            if after != behind and grants(node, after):
                again = shortest(edges, (node, after), way[-1])
                if again is not None:
                    yield again


def least(lengths: Mapping[tuple[int, int], int], behind: int, node: int, goal: int, room: int) -> int | None:
    """Every way without reversing that is not longer than ``room``."""
    if node == goal:
        return 0
    found: list[int] = []
    for ends, length in lengths.items():
        if node in ends and behind not in ends and length <= room:
            rest = least(lengths, node, sum(ends) - node, goal, min([room - length, *found]))
            if rest is not None:
                found.append(length + rest)
    return min(found, default=None)
