"""A path on the wire: moves of four bits, twelve a frame, and the set of frames put together again."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise

from onboard.contract.mapd import PathHead, PathMoves
from onboard.core.effects import Effect, Send
from onboard.systems.mapd.fields import MOST_MOVES, MOVE_BITS, MOVES_A_FRAME
from onboard.systems.mapd.floor import Floor
from onboard.systems.mapd.paths import MOST_KEPT, Path
from onboard.ways.network import Network

_MASK = (1 << MOVE_BITS) - 1


def moves_of(floor: Floor, cells: Sequence[int]) -> list[int]:
    """The code of each move: 0 to wait, n for the n-th way. Raises ``ValueError`` where no way leads on."""
    return [0 if to == cell else floor.ways[cell].index(to) + 1 for cell, to in pairwise(cells)]


def path_frames(sender: int, floor: Floor, path: Path, version: int, *, kept: bool) -> list[Effect]:
    """What tells a path. Raises ``ValueError`` for one of more than ``MOST_MOVES`` moves."""
    moves = moves_of(floor, path.cells)
    if len(moves) > MOST_MOVES:
        raise ValueError(f"a path of {len(moves)} moves")
    effects: list[Effect] = [Send(PathHead(sender, path.start, path.cells[0], len(moves), version, kept))]
    for part in range(-(-len(moves) // MOVES_A_FRAME)):
        some = moves[part * MOVES_A_FRAME : (part + 1) * MOVES_A_FRAME]
        codes = sum(code << MOVE_BITS * place for place, code in enumerate(some))
        effects.append(Send(PathMoves(sender, version, part, codes)))
    return effects


@dataclass
class Assembly:
    """The frames of one robot's newest path, until they are all there; an incomplete set is inert."""

    head: PathHead
    parts: dict[int, int] = field(default_factory=dict)

    def take(self, moves: PathMoves) -> None:
        """One frame, in any order, also twice."""
        if moves.version == self.head.version and moves.part * MOVES_A_FRAME < self.head.moves:
            self.parts[moves.part] = moves.codes

    def path(self, floor: Floor) -> Path | None:
        """The path, where all frames are there and each move is one of the floor."""
        head = self.head
        if len(self.parts) * MOVES_A_FRAME < head.moves or head.cell >= floor.size:
            return None
        codes = tuple(self.parts[part] for part in range(-(-head.moves // MOVES_A_FRAME)))
        cells = _cells(floor.network, head.cell, head.moves, codes)
        return None if cells is None else Path(head.step, cells)


@lru_cache(maxsize=MOST_KEPT)
def _cells(network: Network[int], start: int, count: int, codes: tuple[int, ...]) -> tuple[int, ...] | None:
    """Where ``count`` moves lead from a cell on, None where one is not of the floor: worked out once in one process."""
    cells = [start]
    for number in range(count):
        code = codes[number // MOVES_A_FRAME] >> MOVE_BITS * (number % MOVES_A_FRAME) & _MASK
        ways = network.ways[cells[-1]]
        if code > len(ways):
            return None
        cells.append(ways[code - 1][0] if code else cells[-1])
    return tuple(cells)
