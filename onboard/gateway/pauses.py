"""startPause and stopPause (VDA 5050 2.1, section 6.8.2): a machine is held on the bus, and let go, by its own word.

An order is said until the machine answers it. startPause runs until the machine says that it has come to rest; it is
asked again meanwhile, for its word may be lost, and nothing is told that it has not said.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from onboard.contract.codes import ManualMode
from onboard.contract.messages import ManualOrder, ManualState, Message
from onboard.gateway.dialect import Json

#: The mode that each action asks for.
MODES = {"startPause": ManualMode.HELD, "stopPause": ManualMode.AUTOMATIC}
#: An order that is not answered is said again after this, us (dbc/fleet.dbc), and given up after that: ten words
#: without an answer are a machine that is off.
AGAIN_US, PATIENCE_US = 1_000_000, 10_000_000
#: A machine that has answered and comes to rest is asked again after this, us: to brake takes a few seconds.
RESTS_YET_US = 5_000_000


@dataclass(slots=True)
class _Asked:
    """What is asked of one machine. ``give_up_us`` None: it has answered, and comes to rest."""

    action: Json
    order: ManualOrder
    give_up_us: int | None
    again_us: int


#: An action that is over: whose, which, and why it failed; empty where it did not.
Closed = tuple[int, Json, str]


class Pauses:
    """All machines of a site. ``seed`` begins the numbers of orders, so that another life has others."""

    def __init__(self, sender: int, seed: int) -> None:
        self._sender, self._number = sender, seed % 255
        self._asked: dict[int, _Asked] = {}

    def ask(self, node: int, action: Json, now_us: int) -> list[Closed]:
        """Take up an action of ``MODES``; one that still ran is over, as the newest counts."""
        before = self._asked.pop(node, None)
        self._asked[node] = _Asked(action, self._order(node, action), now_us + PATIENCE_US, now_us)
        return [] if before is None else [(node, before.action, "another one came before it was over")]

    def feed(self, message: Message, now_us: int) -> list[Closed]:
        """Take up a machine's word."""
        asked = self._asked.get(message.sender) if isinstance(message, ManualState) else None
        if not isinstance(message, ManualState) or asked is None:
            return []
        if message.number != asked.order.number:
            if asked.give_up_us is not None:
                return []
            # It had answered mine, so that this is newer: mine, said again, would be an order of now.
            del self._asked[message.sender]
            return [(message.sender, asked.action, "another order came before it was over")]
        if message.manual_mode is not asked.order.manual_mode:
            # An order of another life had this number: the machine takes mine for that one, said again.
            asked.order = self._order(message.sender, asked.action)
            return []
        asked.give_up_us, asked.again_us = None, now_us + RESTS_YET_US
        if message.manual_mode is ManualMode.HELD and not message.at_rest:
            return []
        del self._asked[message.sender]
        return [(message.sender, asked.action, "")]

    def wake(self, now_us: int) -> tuple[list[Message], list[Closed]]:
        """What is to be said, and what nobody has answered."""
        due: list[Message] = []
        closed: list[Closed] = []
        for node, asked in list(self._asked.items()):
            if asked.again_us > now_us:
                continue
            if asked.give_up_us is not None and asked.give_up_us <= now_us:
                del self._asked[node]
                closed.append((node, asked.action, "the machine does not answer"))
            else:
                asked.again_us = now_us + (AGAIN_US if asked.give_up_us is not None else RESTS_YET_US)
                due.append(asked.order)
        return due, closed

    def due(self) -> Iterable[int]:
        """When something is to be said again, or given up, us."""
        return (asked.again_us for asked in self._asked.values())

    def _order(self, node: int, action: Json) -> ManualOrder:
        self._number = self._number % 255 + 1
        return ManualOrder(self._sender, node, self._number, MODES[action["actionType"]])
