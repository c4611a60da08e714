"""What orders become on the bus: the smallest true form of each, as the site's system has it; else they are refused."""

from dataclasses import dataclass
from typing import Any, Protocol

from onboard.contract.codes import KindCode
from onboard.contract.messages import Message, Reference, SyncRequest
from onboard.core.site import Site
from onboard.gateway.order import GatewayOrder, OrderRequest
from onboard.gateway.roles import Role
from onboard.history.history import Fact

#: After its start a gateway asks all what they vouch for, and knows the cars so much later, us: answers to one question
#: come in less.
LISTEN_US = 3_000_000


class RefusedError(Exception):
    """An order that means nothing here: ``reason`` is a word of docs/mqtt.md, ``path`` the place in it."""

    def __init__(self, reason: str, why: str, path: str = "$") -> None:
        super().__init__(f"{path}: {why}")
        self.reason, self.why, self.path = reason, why, path


@dataclass(frozen=True, slots=True)
class OrderMessages:
    """What is said for an order now, and when again, us from now; None for never."""

    messages: tuple[Message, ...]
    again_us: int | None


class BusOrders(Protocol):
    """One system's way. ``no_pause`` tells why its machines cannot be held; empty where they can."""

    no_pause: str

    def ask_all(self, sender: int) -> tuple[Message, ...]:
        """What is asked of all machines at the start."""

    def transport(self, body: dict[str, Any]) -> OrderRequest:
        """What a transport asks of the bus. Raises ``RefusedError``."""

    def check_role(self, request: OrderRequest, role: Role | None) -> None:
        """Raises ``RefusedError`` where what a transport asks is not its giver's to ask; ``role`` None: it has none."""

    def visit(self, node: int, body: dict[str, Any], since: tuple[str, int] | None = None) -> OrderRequest:
        """What a VDA 5050 order asks of a robot; an update's from ``since`` on. Raises ``RefusedError``."""

    def say(self, order: GatewayOrder, sender: int, wall_us: int) -> OrderMessages:
        """Say an order, for the first time or again, at a wall time. Raises ``RefusedError``."""

    def task_of(self, order: GatewayOrder, fact: Fact | None) -> Reference | None:
        """The task that an order has become, where this tells it."""

    def is_done(self, order: GatewayOrder, fact: Fact | None) -> bool:
        """Whether this tells that what the order asks for is so, whoever did it."""


class NoBusOrders:
    """A system that orders cannot be given to in this way."""

    def __init__(self, site: Site) -> None:
        self._site = site
        self.no_pause = site.no_hold and f"not supported: {site.no_hold}"

    def ask_all(self, sender: int) -> tuple[Message, ...]:
        """What they vouch for, and who is held."""
        return (SyncRequest(sender, 0),)

    def transport(self, body: dict[str, Any]) -> OrderRequest:
        """Raises ``RefusedError``: this system takes no transports from outside."""
        raise RefusedError("UNSUPPORTED", f"a {self._site.called} takes no transports from outside its desks")

    def check_role(self, request: OrderRequest, role: Role | None) -> None:
        """Nothing here is anybody's own: whoever the broker lets write may order."""

    def visit(self, node: int, body: dict[str, Any], since: tuple[str, int] | None = None) -> OrderRequest:
        """Raises ``RefusedError``: machines of this system take no orders by name."""
        raise RefusedError("UNSUPPORTED", f"machines of a {self._site.called} take no orders by name")

    def say(self, order: GatewayOrder, sender: int, wall_us: int) -> OrderMessages:
        """Raises ``RefusedError``: no order can have been taken before."""
        raise RefusedError("UNSUPPORTED", "not of this site")

    def task_of(self, order: GatewayOrder, fact: Fact | None) -> Reference | None:
        """None: nothing that is told is about an order from outside."""
        return None

    def is_done(self, order: GatewayOrder, fact: Fact | None) -> bool:
        """False: only a report of the task can say so."""
        return False


def is_robot(site: Site, node: int) -> bool:
    """Whether a node is a machine that carries."""
    machine = site.machines.get(node)
    return machine is not None and machine.kind in (KindCode.ROBOT, KindCode.VEHICLE)


def refuse_load(body: dict[str, Any]) -> None:
    """Where loads have no names of their own. Raises ``RefusedError`` for a transport that names one."""
    if "load" in body:
        raise RefusedError("UNSUPPORTED", "loads have no names here", "$.load")


def refuse_fetch_at(body: dict[str, Any]) -> None:
    """Where nothing waits to be fetched. Raises ``RefusedError`` for a transport that announces when."""
    if "fetch_at" in body:
        raise RefusedError("UNSUPPORTED", "nothing is fetched later here; order it then", "$.fetch_at")


def refuse_charging(body: dict[str, Any], why: str = "nothing is charged here; leave it out") -> None:
    """Raises ``RefusedError`` for a transport that asks for a place to charge."""
    if body.get("charging"):
        raise RefusedError("UNSUPPORTED", why, "$.charging")
