"""What decides what the shipped book of rights and its witness do about one token, as a value; and they from it."""

from collections.abc import Iterable
from typing import NamedTuple

from bus_sim.sites import find_site
from onboard.contract.codes import KindCode, MachineState, Reason, TokenKind
from onboard.contract.constants import NOBODY
from onboard.contract.messages import TokenGrant
from onboard.core.authority import Grant, TokenBook, TokenKey
from onboard.core.belief import Belief
from onboard.core.mirror import Mirror, Peer
from onboard.holon.witness import Doubt, Witness
from onboard.systems.car_park.site import car_park

SITE = car_park(find_site("small"))
KEY = TokenKey(TokenKind.STATION, next(iter(SITE.compartments.values())).number)
#: Any moment: whatever is to be said again is due.
NOW_US = 1 << 40


class Memory(NamedTuple):
    """What one node remembers of the token; hints, counts and times are left out, as nothing is decided by them."""

    held: int | None = None
    leaving: tuple[int, int] | None = None
    seen: int | None = None
    given: Belief | None = None
    belief: Belief | None = None
    disputed: TokenGrant | None = None
    is_synced: bool = True
    asked: frozenset[int] = frozenset()
    answered: frozenset[int] = frozenset()
    doubted: tuple[tuple[int, int], ...] = ()
    doubt: bool = False
    starting: frozenset[int] = frozenset()
    is_gift: bool = False


def load(node: int, nodes: Iterable[int], memory: Memory) -> tuple[TokenBook, Witness]:
    """The shipped book and witness of one of these nodes that remember this."""
    book = TokenBook(SITE, node)
    if memory.held is not None:
        book.held[KEY] = memory.held
    if memory.leaving is not None:
        book.leaving[KEY] = Grant(*memory.leaving, 0)
    if memory.seen is not None:
        book.seen[KEY] = memory.seen
    if memory.given is not None:
        book.given[KEY] = memory.given
    if memory.belief is not None:
        book.beliefs.verified[KEY] = memory.belief
    if memory.disputed is not None:
        book._disputed[KEY] = memory.disputed
    book.is_synced, book.asked = memory.is_synced, set(memory.asked)
    return book, witness_of(book, nodes, memory)


def witness_of(book: TokenBook, nodes: Iterable[int], memory: Memory) -> Witness:
    """The shipped witness beside a book."""
    mirror = Mirror(SITE, book.node_id)
    for node in nodes:
        if node != book.node_id:
            mirror.peers[node] = Peer(KindCode.ROBOT, MachineState.IDLE, 2, 0, NOW_US, 0, 0)
    witness = Witness(book, mirror, 2, True, lambda _: book.statements())
    witness.answered = dict.fromkeys(memory.answered, 2)
    witness.doubt = Doubt(Reason.JOURNAL_SHORT, NOBODY, "") if memory.doubt else None
    witness.doubted = {node: {KEY: version} for node, version in memory.doubted}
    witness.starting = set(memory.starting)
    if memory.is_gift:
        book.gifts.add(KEY)
    # It has listened for long enough whenever all have answered.
    witness._since_us = 0
    return witness


def saved(book: TokenBook, witness: Witness, nodes: Iterable[int]) -> Memory:
    """What they remember."""
    known = set(nodes)
    leaving = book.leaving.get(KEY)
    return Memory(
        book.held.get(KEY),
        leaving and (leaving.version, leaving.holder),
        book.seen.get(KEY),
        book.given.get(KEY),
        book.beliefs.verified.get(KEY),
        book._disputed.get(KEY),
        book.is_synced,
        frozenset(book.asked & known),
        frozenset(witness.answered),
        tuple((node, lost[KEY]) for node, lost in sorted(witness.doubted.items()) if KEY in lost),
        witness.doubt is not None,
        frozenset(witness.starting & known),
        bool(witness.starting) and KEY in book.gifts,
    )
