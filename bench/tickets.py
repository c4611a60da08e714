"""What guessing tickets at a desk comes to: ``python -m bench.tickets 1000000``.

Somebody knows the numbers of all cars that are inside and puts tickets of any code in, one a second, as fast as the
lock lets them count. Told: tickets that were looked at, refused unread by the locked desk, cars, and the time at the
desk. Then as many codes beside no desk at all, as if the lock were not there.
"""

import random
from collections import Counter
from collections.abc import Callable
from typing import NamedTuple

from bench._arguments import a_count, given
from bus_sim.sites import find_site
from onboard.contract.codes import DeskInput, Reason
from onboard.contract.messages import DeskEvent, Reference, TicketRead
from onboard.core.authority import TokenBook, station_token
from onboard.core.effects import Effect
from onboard.core.motion_authority import MotionAuthority
from onboard.systems.car_park.outputs import BayOutputs
from onboard.systems.car_park.site import car_park
from onboard.systems.car_park.ticket_slot import TicketSlot
from onboard.systems.car_park.tickets import CODE_BITS, Ticket, TicketCodes, split

#: A person with a machine that puts tickets in, us.
PACE_US = 1_000_000
DAY_US = 86_400_000_000


class Guessing(NamedTuple):
    """Tickets by what became of them, and bus time at the end, us."""

    read: int
    unread: int
    cars: int
    time_us: int


def at_a_desk(guesses: int, chance: random.Random, codes: TicketCodes) -> Guessing:
    """One desk of ``small``, with a car for each number up to 200."""
    site = car_park(find_site("small"))
    node, station = next(iter(site.compartments.items()))
    drops: Counter[Reason] = Counter()
    outputs = BayOutputs(node, MotionAuthority(TokenBook(site, node)), station_token(station), codes)
    slot, cars, now_us = TicketSlot(outputs, drops, lambda *_: []), 0, 0

    def fetch(_: DeskInput, __: Reference) -> list[Effect]:
        nonlocal cars
        cars += 1
        return []

    for guess in range(guesses):
        now_us += PACE_US
        _put_in(slot, node, guess % 255 + 1, _guess(chance, node), now_us, fetch)
    return Guessing(drops[Reason.UNKNOWN_TICKET], guesses - cars - drops[Reason.UNKNOWN_TICKET], cars, now_us)


def _put_in(
    slot: TicketSlot,
    node: int,
    sequence: int,
    ticket: Ticket,
    now_us: int,
    fetch: Callable[[DeskInput, Reference], list[Effect]],
) -> None:
    for half, code in enumerate(split(ticket.code)):
        slot.take(TicketRead(node, sequence, half, code), now_us, fetch)
    slot.take(DeskEvent(node, sequence, DeskInput.TICKET, ticket.car), now_us, fetch)


def _guess(chance: random.Random, node: int) -> Ticket:
    return Ticket(Reference(node, chance.randint(1, 200)), chance.getrandbits(CODE_BITS))


def beside_a_desk(guesses: int, chance: random.Random, codes: TicketCodes) -> int:
    """How many of so many codes are right."""
    return sum(codes.is_right(_guess(chance, 1)) for _ in range(guesses))


def main() -> None:
    """How many tickets the first argument says; a million without one."""
    guesses = given(guesses=(a_count, 1_000_000)).guesses
    chance = random.Random(1)
    codes = TicketCodes((chance.randbytes(32),))
    found = at_a_desk(guesses, chance, codes)
    print(f"at a desk: {guesses:,} tickets, {found.read:,} read, {found.unread:,} refused unread, cars {found.cars}")
    print(f"           {found.time_us / DAY_US:.1f} days; all of them read would take {_days(guesses, found):,.0f}")
    print(f"no lock:   {guesses:,} codes, right {beside_a_desk(guesses, chance, codes)}")


def _days(guesses: int, found: Guessing) -> float:
    return found.time_us / DAY_US * guesses / max(1, found.read)


if __name__ == "__main__":
    main()
