"""Words of a manufacturing cell: parts by their numbers, goals by their points in metres."""

from collections import OrderedDict

from onboard.contract.cell import ArmPhase, ArmProgress, GoalEnd, GoalStart
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import CallForProposals, Message, Reference
from onboard.systems.cell.site import Cell
from onboard.systems.words import SiteWords

#: Goals that are remembered: the newest.
MOST_KEPT = 256
_DEEDS = {
    ArmPhase.IDLE: "rests",
    ArmPhase.TO_PART: "goes to the part",
    ArmPhase.TAKING: "takes the part",
    ArmPhase.CARRYING: "carries the part",
    ArmPhase.PUTTING: "puts the part down",
    ArmPhase.WAITING: "waits",
}


class CellWords(SiteWords):
    """What a cell's messages mean."""

    noun = "part"
    silent = frozenset({"wheelbase_mm", "station", "to_station"})

    def __init__(self, site: Cell) -> None:
        super().__init__(site)
        self._points: OrderedDict[tuple[type[Message], int, int], str] = OrderedDict()
        nodes = dict.fromkeys((f"node{number}" for number in range(1, 9)), self.machine)
        self.signals = {**nodes, "manager": self.machine}

    def hear(self, message: Message) -> None:
        """Where goals begin and end."""
        if isinstance(message, GoalStart | GoalEnd):
            self._points[type(message), message.sender, message.goal] = metres(message.x_mm, message.y_mm)
            if len(self._points) > 2 * MOST_KEPT:
                self._points.popitem(last=False)

    def load(self, value: Reference) -> str:
        """A part goes by its number at its desk."""
        return str(value.number) if any(value) else "none"

    def place(self, number: int) -> str:
        """Calls name a goal, and its points are told beside them."""
        return "anywhere" if number == ANY_STATION else f"goal {number}"

    def way(self, call: CallForProposals) -> str:
        """From point to point, where the goal's points were heard."""
        ends = [self._points.get((kind, call.sender, call.from_station)) for kind in (GoalStart, GoalEnd)]
        return " to ".join(end for end in ends if end is not None) if all(ends) else self.place(call.from_station)

    def deed(self, message: Message) -> str:
        """What an arm is at."""
        return _DEEDS[message.arm_phase] if isinstance(message, ArmProgress) else ""

    def done(self, load: Reference, station: int) -> str:
        """A part is where its goal ends."""
        return f"has brought {self.thing(load)}"


def metres(x_mm: float, y_mm: float) -> str:
    """A point of the cell."""
    return f"({x_mm / 1000:.1f}, {y_mm / 1000:.1f}) m"


WORDS = CellWords
