"""Words of a container terminal: boxes, lanes and stations by the names of the site file."""

from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import Message, Reference
from onboard.contract.terminal import Action, PlanHead, PlanStep, StepReport, StepResult
from onboard.systems.terminal.site import Terminal
from onboard.systems.words import SiteWords, plain

_PLACES = ("entity", "lane", "source", "target", "towards")
_MACHINES = ("after", "desk", "vehicle")
_VERBS = {Action.GOTO: "drives through"}


class TerminalWords(SiteWords):
    """What a terminal's messages mean."""

    noun = "box"
    silent = frozenset({"wheelbase_mm"})

    def __init__(self, site: Terminal) -> None:
        super().__init__(site)
        self._site = site
        self._plans: dict[int, dict[int, PlanStep]] = {}
        self.signals = {
            **dict.fromkeys(_PLACES, self._entity),
            **dict.fromkeys(_MACHINES, self.machine),
            "box": lambda number: self.load(Reference(0, number)),
        }

    def hear(self, message: Message) -> None:
        """Plans: a report names a step."""
        match message:
            case PlanHead():
                self._plans[message.sender] = {}
            case PlanStep():
                self._plans.setdefault(message.sender, {})[message.step] = message

    def load(self, value: Reference) -> str:
        """A box by its name in the site file."""
        if 0 < value.number <= len(self._site.boxes):
            return self._site.boxes[value.number - 1].name
        return str(value.number) if value.number else "none"

    def place(self, number: int) -> str:
        """A station, area, lane or crossing."""
        entity = self._site.entities.get(number)
        return entity.name if entity is not None else "anywhere" if number == ANY_STATION else f"place {number}"

    def slot(self, track: int, index: int) -> str:
        """One of an entity's slots, counted from where a lane is entered."""
        return f"slot {index} of {self.place(track)}"

    def deed(self, message: Message) -> str:
        """The step of its plan that a vehicle is at."""
        if not isinstance(message, StepReport):
            return ""
        if message.result is not StepResult.DONE:
            return f"{plain(message.result.name)} at {self.place(message.entity)}"
        step = self._plans.get(message.sender, {}).get(message.step + 1)
        if step is None:
            return f"stands at {self.place(message.entity)}"
        return f"{_VERBS.get(step.action) or f'{_present(step.action)} at'} {self.place(step.entity)}"

    def done(self, load: Reference, station: int) -> str:
        """A box is put down."""
        return f"has put the box down at {self.place(station)}"

    def _entity(self, number: int) -> str:
        return self.place(number) if number else "none"


def _present(action: Action) -> str:
    """``dock`` as ``docks``, ``pick_up`` as ``picks up``."""
    verb, *rest = plain(action.name).split()
    return " ".join([f"{verb}s", *rest])


WORDS = TerminalWords
