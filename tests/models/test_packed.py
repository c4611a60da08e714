"""The search of all explorations sees what one sees that keeps no sums, where faults decide what comes next too."""

from collections.abc import Iterator

from tests.models.packed import Search, Split, Verdict

#: Of two machines how far each has come, None while it is down; how many have crashed; what was said, by bits.
Walk = tuple[tuple[int | None, int | None], int, int]
_FAR = 3


class Walkers:
    """Each goes on when the other has said that it did, or by itself at first; one crash is allowed."""

    nodes = (1, 2)
    stays = (~0,)

    def begin(self) -> Walk:
        return (0, 0), 0, 0

    def split(self, state: Walk) -> Split:
        return Split(*state)

    def join(self, split: Split) -> Walk:
        first, second = split.parts
        assert (first is None or isinstance(first, int)) and (second is None or isinstance(second, int))
        return (first, second), split.faults, split.bus

    def heeds(self, i: int) -> int:
        return 0b0101 << (1 - i)

    def moves(self, state: Walk, i: int) -> Iterator[Walk]:
        parts, crashes, bus = state
        at = parts[i]
        if at is None:
            return
        is_told = bool(bus & self.heeds(i)) or at == 0
        if at < _FAR and is_told:
            yield self._put(parts, i, at + 1), crashes, bus | 1 << (2 * (at & 1) + i)
        if crashes < 1:
            yield self._put(parts, i, None), crashes + 1, bus

    def _put(self, parts: tuple[int | None, int | None], i: int, part: int | None) -> tuple[int | None, int | None]:
        return (part, parts[1]) if i == 0 else (parts[0], part)

    def alone(self, state: Walk) -> Iterator[tuple[Walk, int]]:
        parts, crashes, bus = state
        for i in (0, 1):
            if parts[i] is None:
                yield (self._put(parts, i, 0), crashes, bus), 0

    def is_wrong(self, state: Walk) -> bool:
        return False

    def verdict(self, state: Walk) -> Verdict:
        return Verdict.GOES_ON


def one_by_one(model: Walkers) -> set[Walk]:
    seen, waiting = {model.begin()}, [model.begin()]
    while waiting:
        state = waiting.pop()
        found = {after for after, _ in model.alone(state)} | {after for i in (0, 1) for after in model.moves(state, i)}
        waiting += found - seen
        seen |= found
    return seen


def test_nobody_crashes_more_often_than_is_allowed() -> None:
    """What a machine does was kept by what it knows alone: whoever was up when another had crashed crashed as well."""
    model = Walkers()
    search = Search(model)
    assert search.run().is_complete
    states = {search.unpack(packed) for packed in search.came_from}
    assert states == one_by_one(model)
    assert {crashes for _, crashes, _ in states} == {0, 1}
