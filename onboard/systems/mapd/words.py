"""Words of a pick-up and delivery site: cells by the names of its map, tasks by their numbers."""

from onboard.core.codes import TokenKind
from onboard.core.messages import Message, Reference
from onboard.core.site import Station
from onboard.systems.mapd.messages import NO_TASK, StepState
from onboard.systems.mapd.rights import resource_number
from onboard.systems.mapd.site import Mapd
from onboard.systems.words import SiteWords


class MapdWords(SiteWords):
    """What a pick-up and delivery site's messages mean."""

    noun = "task"
    no_calls = "its robots share tasks out in rounds and not by calls; `onboard trace dump --decode` shows the rounds"

    def __init__(self, site: Mapd) -> None:
        super().__init__(site)
        self._site = site
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

    def deed(self, message: Message) -> str:
        """What a robot does in its step."""
        if not isinstance(message, StepState):
            return ""
        if message.task == NO_TASK:
            return "has no task"
        return f"{'delivers' if message.loaded else 'goes to pick up'} task {message.task}"

    def done(self, load: Reference, station: int) -> str:
        """A task is delivered."""
        return f"has delivered {self.thing(load)}"


WORDS = MapdWords
