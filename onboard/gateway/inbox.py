"""What arrives as an order: bounded, parsed, checked; refused with a path and a reason, or handed on. Never raises."""

import json
import re
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, replace
from typing import Any

from onboard.gateway.dialect import Dialect
from onboard.gateway.factsheet import MOST_ACTIONS, MOST_BYTES, MOST_ID
from onboard.gateway.schema import TRANSPORT, schema
from onboard.nesting import is_deeper
from onboard.ports.broker import Publication

#: Orders taken up at once, and how fast the allowance grows again, us an order: a burst of 20, then one a second: more
#: than people press, less than a fleet bus feels. Instant actions of each machine have as many of their own: whoever
#: floods one topic takes nobody else's pause away.
BURST, RATE_US = 20, 1_000_000
#: Objects and lists within each other: an order of VDA 5050 has 7, and what stands in a parameter of an action.
MOST_DEPTH = 32
#: A name that gives orders, as the level of a topic.
GIVER = re.compile(r"[A-Za-z0-9_.:-]{1,64}")


@dataclass(frozen=True, slots=True)
class Incoming:
    """One order. ``kind``: ``transport``, or ``order`` and ``instantActions`` of VDA 5050 to the machine ``serial``.

    Where ``reason`` is not empty it is refused: ``path`` is the place in it. ``body`` is what could be read of it.
    """

    kind: str
    serial: str
    body: dict[str, Any]
    reason: str = ""
    path: str = ""
    why: str = ""
    #: Who gave it, by the topic; empty where that names nobody.
    giver: str = ""


@dataclass(slots=True)
class _Allowance:
    """``left`` of ``BURST`` may come at once; since ``filled_us`` none has grown again."""

    filled_us: int
    left: int = BURST

    def take(self, now_us: int) -> bool:
        """Whether one more may come."""
        gained = (now_us - self.filled_us) // RATE_US
        self.left = min(BURST, self.left + gained)
        self.filled_us += gained * RATE_US
        if not self.left:
            return False
        self.left -= 1
        return True


class Inbox:
    """Judges publications one after another. ``refused`` counts by reason."""

    def __init__(self, dialect: Dialect, root: str, manufacturer: str, givers: Collection[str] = ()) -> None:
        """``root`` is PREFIX/SITE; ``givers`` have an allowance of their own each."""
        self.refused: Counter[str] = Counter()
        self._dialect = dialect
        self._transport = f"{root}/orders"
        self._machines = f"{dialect.topic_root}/{manufacturer}/"
        self._givers = givers
        #: By the machine whose instant actions they are, or the giver; those of all other orders are under no name.
        self._allowances: dict[str, _Allowance] = {}

    @property
    def subscriptions(self) -> tuple[str, ...]:
        """What is to be subscribed to."""
        return (
            self._transport,
            f"{self._transport}/+",
            f"{self._machines}+/order",
            f"{self._machines}+/instantActions",
        )

    def is_action(self, topic: str) -> bool:
        """Whether a topic is that of instant actions."""
        return self._kind(topic)[0] == "instantActions"

    def judge(self, publication: Publication, now_us: int) -> Incoming | None:
        """One publication; None for a topic that is not of orders."""
        kind, serial = self._kind(publication.topic)
        if not kind:
            return None
        found = replace(self._judge(kind, serial, publication, now_us), giver=self._giver(publication.topic))
        if found.reason:
            self.refused[found.reason] += 1
        return found

    def refuse(self, order: Incoming, reason: str, why: str, path: str = "$") -> Incoming:
        """The same order, refused for what it means; counted."""
        self.refused[reason] += 1
        return replace(order, reason=reason, path=path, why=why)

    def _judge(self, kind: str, serial: str, publication: Publication, now_us: int) -> Incoming:
        if len(publication.payload) > MOST_BYTES:
            return Incoming(kind, serial, {}, "OVERSIZED", "$", f"at most {MOST_BYTES} bytes are taken")
        try:
            body = _parsed(publication.payload)
        except (ValueError, RecursionError) as error:
            return Incoming(kind, serial, {}, "MALFORMED", "$", f"no JSON to be taken: {str(error)[:100]}")
        named = body if isinstance(body, dict) else {}
        name = TRANSPORT if kind == TRANSPORT else f"{self._dialect.number}/{kind}"
        wrong = schema(name).first_error(body)
        if wrong is not None:
            return Incoming(kind, serial, named, "MALFORMED", *wrong)
        if kind != TRANSPORT:
            mine = (("serialNumber", serial), ("manufacturer", self._machines.split("/")[-2]))
            for key, value in mine:
                if body[key] != value:
                    return Incoming(kind, serial, named, "MALFORMED", f"$.{key}", f"must be that of the topic, {value}")
            wrong = _too_long(kind, body)
            if wrong is not None:
                return Incoming(kind, serial, named, "TOO_LONG", *wrong)
        if publication.retain:
            # Kept by the broker from who knows when: an order is not to be carried out at every start.
            return Incoming(kind, serial, named, "RETAINED", "$", "an order must not be retained")
        giver = self._giver(publication.topic)
        whose = f"orders/{giver}" if giver in self._givers else serial if kind == "instantActions" else ""
        if not self._allowances.setdefault(whose, _Allowance(now_us)).take(now_us):
            return Incoming(kind, serial, named, "TOO_FAST", "$", f"{BURST} at once and one a second are taken")
        return Incoming(kind, serial, named)

    def _giver(self, topic: str) -> str:
        name = topic.removeprefix(f"{self._transport}/")
        return name if name != topic and GIVER.fullmatch(name) else ""

    def _kind(self, topic: str) -> tuple[str, str]:
        if topic == self._transport or self._giver(topic):
            return TRANSPORT, ""
        serial, _, name = topic.removeprefix(self._machines).partition("/")
        is_order = topic.startswith(self._machines) and name in ("order", "instantActions")
        return (name, serial) if is_order else ("", "")


def _too_long(kind: str, body: dict[str, Any]) -> tuple[str, str] | None:
    """What the factsheet's limits forbid and the schema of its kind does not: path and reason.

    A name that this schema does not know may hold anything.
    """
    if kind == "order":
        too_long = len(body["orderId"]) > MOST_ID
        return ("$.orderId", f"must have at most {MOST_ID} characters") if too_long else None
    if len(body["actions"]) > MOST_ACTIONS:
        return "$.actions", f"must have at most {MOST_ACTIONS} elements"
    for number, action in enumerate(body["actions"]):
        if max(len(action["actionId"]), len(action["actionType"])) > MOST_ID:
            return f"$.actions[{number}].actionId", f"must have at most {MOST_ID} characters"
    return None


def _parsed(payload: bytes) -> Any:
    """Raises ``ValueError`` for no JSON, and for more than ``MOST_DEPTH``; ``RecursionError`` where it is far more."""
    found = json.loads(payload, parse_constant=_no_constant)
    if is_deeper(found, MOST_DEPTH):
        raise ValueError(f"nested deeper than {MOST_DEPTH}")
    return found


def _no_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON")
