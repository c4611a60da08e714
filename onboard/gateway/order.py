"""One order from outside and what is known of it: its life as it is told back, and its record in the journal."""

import zlib
from dataclasses import dataclass, replace

from onboard.contract.messages import Reference
from onboard.gateway.records import OrderPhase, WishRecord
from onboard.ports.journal import Entry

#: In the order in which they come; an order never goes back but to CALLED, when it is called again.
RANK = {life: rank for rank, life in enumerate(OrderPhase)}


@dataclass(frozen=True, slots=True)
class OrderRequest:
    """What an order asks of the bus: a compartment to fetch ``car`` or to park, or a robot to visit ``stops``.

    ``base`` is the last node that a VDA 5050 order releases and its sequence number, where an update goes on;
    ``is_open`` tells that it has a horizon, so that an update is to come (VDA 5050 2.1, section 6.6.4).

    ``node`` is the compartment or robot; ``number`` names a visit list on the bus (16 bits); ``urgent`` overtakes;
    ``charging`` asks for a place at which the car that is parked is charged; ``fetch_us`` announces when ``car`` will
    be fetched, wall time in us since 1970.
    """

    what: str
    node: int
    car: Reference | None = None
    stops: tuple[int, ...] = ()
    number: int = 0
    urgent: bool = False
    base: tuple[str, int] = ("", 0)
    is_open: bool = False
    charging: bool = False
    fetch_us: int | None = None


@dataclass(slots=True)
class GatewayOrder:
    """One order. ``name`` is the giver's; ``content`` tells a second order under the same name from a repetition.

    Times in us of the loop; ``before_us`` in wall time since 1970. ``due_us``: when it is to be said (again).
    """

    name: str
    request: OrderRequest
    content: int
    before_us: int | None = None
    update: int = 0
    life: OrderPhase = OrderPhase.ACCEPTED
    reason: str = ""
    why: str = ""
    task: Reference | None = None
    owner: int = 0
    was_said: bool = False
    due_us: int | None = None
    #: Stops of updates, list by list, that the robot gets once it has done those of ``request``.
    ahead: tuple[tuple[int, ...], ...] = ()
    #: It was taken back while the robot had it: the robot is told until it says so.
    is_cancelled: bool = False
    #: Who gave it, as the broker lets nobody else say; empty where nobody is named.
    giver: str = ""

    def entry(self) -> Entry:
        """The whole order, for the journal; the newest record of a name counts."""
        request = self.request
        return WishRecord(
            self.name,
            request.what,
            request.node,
            request.stops,
            request.number,
            request.urgent,
            self.content,
            self.update,
            self.life,
            self.reason,
            self.why,
            self.owner,
            self.was_said,
            ahead=",".join(_words(stops) for stops in self.ahead),
            base=request.base[0],
            sequence=request.base[1],
            open=request.is_open,
            cancelled=self.is_cancelled,
            car=request.car,
            task=self.task,
            before_us=self.before_us,
            charging=request.charging,
            giver=self.giver,
            fetch_us=request.fetch_us,
        ).entry


def order_of(record: WishRecord) -> GatewayOrder:
    """The order that a journal record of it stands for."""
    request = OrderRequest(
        record.what,
        record.node,
        record.car,
        record.stops,
        record.number,
        record.urgent,
        (record.base, record.sequence),
        record.open,
        record.charging,
        record.fetch_us,
    )
    return GatewayOrder(
        record.name,
        request,
        record.content,
        record.before_us,
        record.update,
        record.life,
        record.reason,
        record.why,
        record.task,
        record.owner,
        record.said,
        ahead=tuple(_numbers(stops) for stops in record.ahead.split(",")) if record.ahead else (),
        is_cancelled=record.cancelled,
        giver=record.giver,
    )


def same_content(*parts: object) -> int:
    """A number that is the same for an order that is sent again: CRC-32 of what it says."""
    return zlib.crc32(repr(parts).encode())


def with_number(request: OrderRequest, number: int) -> OrderRequest:
    """The same request under a number on the bus."""
    return replace(request, number=number)


def _words(stops: tuple[int, ...]) -> str:
    return " ".join(str(stop) for stop in stops)


def _numbers(words: str) -> tuple[int, ...]:
    return tuple(int(one) for one in words.split())
