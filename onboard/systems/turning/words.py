"""Words of a turning cell: orders with what is to be made, drawings and materials by name, prices as money."""

from collections import OrderedDict

from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import CallForProposals, Message, Reference
from onboard.contract.turning import LathePhase, LatheProgress, TurningOrder
from onboard.systems.turning.site import Turning
from onboard.systems.words import SiteWords

#: Orders that are remembered: the newest.
MOST_KEPT = 256
_DEEDS = {
    LathePhase.SETTING_UP: "sets up for",
    LathePhase.TURNING: "turns",
    LathePhase.FINISHED: "has finished",
}


class TurningWords(SiteWords):
    """What a turning cell's messages mean."""

    noun = "order"
    silent = frozenset({"wheelbase_mm", "station", "from_station", "to_station"})

    def __init__(self, site: Turning) -> None:
        super().__init__(site)
        self._site = site
        self._orders: OrderedDict[Reference, TurningOrder] = OrderedDict()
        self.signals = {
            "manager": self.machine,
            "drawing": lambda number: site.drawings[number].name if number in site.drawings else str(number),
            "material": lambda number: site.materials[number].name if number in site.materials else str(number),
        }

    def hear(self, message: Message) -> None:
        """What is to be made of an order."""
        if isinstance(message, TurningOrder):
            self._orders[Reference(message.sender, message.task)] = message
            if len(self._orders) > MOST_KEPT:
                self._orders.popitem(last=False)

    def load(self, value: Reference) -> str:
        """An order goes by its number at its desk."""
        return str(value.number) if any(value) else "none"

    def thing(self, value: Reference) -> str:
        """An order with what is to be made."""
        order = self._orders.get(value)
        drawing = self._site.drawings.get(order.drawing) if order is not None else None
        if order is None or drawing is None:
            return super().thing(value)
        return f"{super().thing(value)}, {order.batch} x {drawing.name}"

    def place(self, number: int) -> str:
        """Bars come and parts go by hand."""
        return "anywhere" if number == ANY_STATION else f"place {number}"

    def way(self, call: CallForProposals) -> str:
        """What is turned goes nowhere."""
        return ""

    def deed(self, message: Message) -> str:
        """The order on the lathe, and how far it is."""
        if not isinstance(message, LatheProgress) or message.lathe_phase not in _DEEDS:
            return ""
        return f"{_DEEDS[message.lathe_phase]} {super().thing(Reference(message.manager, message.task))}"

    def done(self, load: Reference, station: int) -> str:
        """What is said when a batch was made."""
        return f"has made {self.thing(load)}"


WORDS = TurningWords
