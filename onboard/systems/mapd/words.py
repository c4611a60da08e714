"""Words of a pick-up and delivery site: cells by the names of its map, tasks by their numbers."""

from onboard.contract.codes import Criterion, TokenKind
from onboard.contract.mapd import StepState
from onboard.contract.messages import Message, Reference
from onboard.core.site import Station
from onboard.systems.mapd.fields import NO_TASK
from onboard.systems.mapd.rights import resource_number
from onboard.systems.mapd.site import Mapd
from onboard.systems.words import SiteWords


class MapdWords(SiteWords):
    """What a pick-up and delivery site's messages mean."""

    noun = "task"
    silent = frozenset({"wheelbase_mm", "car"})

    def __init__(self, site: Mapd) -> None:
        super().__init__(site)
        self._site = site
        self._in_hand: dict[int, int] = {}
        self._served: tuple[Message, int] | None = None
        self.signals = {
            **dict.fromkeys(("cell", "pickup", "delivery"), self.place),
            "robot": self.machine,
            "task": lambda number: "none" if number == NO_TASK else str(number),
        }

    def load(self, value: Reference) -> str:
        """A task goes by its number."""
        return str(value.number)

    def place(self, number: int) -> str:
        """A cell by its name on the map."""
        names = self._site.floor.names
        return names[number] if number < len(names) else f"cell {number}"

    def resource(self, kind: TokenKind, number: int) -> str:
        """A cell; a zone goes by its lowest one."""
        if kind is not TokenKind.STATION:
            return super().resource(kind, number)
        return f"cell {self.place(resource_number(Station.from_number(number)))}"

    def hear(self, message: Message) -> None:
        """What each robot has in hand: it says only that this was served."""
        if isinstance(message, StepState):
            before = self._in_hand.pop(message.sender, NO_TASK)
            if message.served and before != NO_TASK:
                self._served = message, before
            if message.task != NO_TASK:
                self._in_hand[message.sender] = message.task

    def finished(self, message: Message) -> Reference | None:
        """A robot's step tells that what it had is delivered."""
        told = self._served
        return Reference(self._site.desk, told[1]) if told is not None and told[0] is message else None

    def cost(self, cost: int, criterion: Criterion | None) -> str:
        """Bids are in hundredths of a step."""
        return f"{cost / 100:.2f} steps"

    def deed(self, message: Message) -> str:
        """What a robot does in its step."""
        if not isinstance(message, StepState):
            return ""
        if message.task == NO_TASK:
            return "has no task"
        return f"{'delivers' if message.loaded else 'goes to pick up'} task {message.task}"

    def done(self, load: Reference, station: int) -> str:
        """What is said when a task was delivered."""
        return f"has delivered {self.thing(load)}"


WORDS = MapdWords
