"""The turning cell: nothing drives there, so each lathe is a card with its orders, the parts made and worn edges."""

from onboard.contract.messages import Message, Reference
from onboard.contract.turning import LathePhase, LatheProgress, NcMode
from onboard.contract.turning_device import NcState, ToolState
from onboard.history.history import Fact
from onboard.systems.turning.history import ProgressTold, turning_history
from onboard.systems.turning.site import Turning
from onboard.trace.scene.scene import Json, shape, still
from onboard.trace.view import SiteView

#: Plan units of a card, and between cards.
WIDTH, HEIGHT, GAP = 300.0, 250.0, 24.0
#: Lathes side by side.
COLUMNS = 3


class TurningScene:
    """Fed beside ``view``, which knows the calls."""

    def __init__(self, site: Turning, view: SiteView) -> None:
        self.site = site
        self.view = view
        self.words = view.words
        self._seen = turning_history(view.history)
        self._modes: dict[int, NcMode] = {}
        self._worn: dict[tuple[int, int], int] = {}

    def layout(self) -> Json:
        """A card for each lathe."""
        shapes = []
        for number, (node, lathe) in enumerate(self.site.lathes.items()):
            x = GAP + number % COLUMNS * (WIDTH + GAP)
            y = GAP + number // COLUMNS * (HEIGHT + GAP)
            shapes.append(shape(f"m{node}", "card", lathe.name, [(x, y), (x + WIDTH, y + HEIGHT)], node=node))
        rows = -(-len(shapes) // COLUMNS)
        columns = max(1, min(COLUMNS, len(shapes)))
        size = {"width": GAP + columns * (WIDTH + GAP), "height": GAP + rows * (HEIGHT + GAP)}
        return {"plan": {**size, "shapes": shapes}}

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """Follow bills, lathes, jobs and calls for the plan."""
        if isinstance(fact, ProgressTold) and fact.is_news:
            words = fact.word.lathe_phase.name.lower().replace("_", " ")
            self.view.say(time_us, f"{self.view.name(fact.word.sender)}: {self.words.thing(fact.task)}, {words}")

    def feed_device(self, node: int, message: Message, time_us: int) -> None:
        """What a numerical control does, and its edges."""
        match message:
            case NcState():
                self._modes[node] = message.nc_mode
            case ToolState():
                self._worn[node, message.tool] = message.used_ms

    def machine(self, node: int, now_us: int) -> Json:
        """As in the port; a lathe is drawn as its card."""
        row = self._seen.progress.get(node)
        if row is None:
            return {"where": "", "car": None}
        here = next((one for one in row.values() if one.lathe_phase is not LathePhase.QUEUED), None)
        words = "" if here is None else f"{here.lathe_phase.name.lower().replace('_', ' ')} {here.made} of {here.batch}"
        told = [[None, self._line(node, task, one)] for task, one in row.items()]
        car = None if here is None else str(here.task)
        return {"where": words, "car": car, "path": still((0, 0)), "ahead": [], "held": [], "told": told}

    def marks(self, now_us: int) -> Json:
        """Lines and bars of every card."""
        marks: Json = {}
        for node, lathe in self.site.lathes.items():
            row = self._seen.progress[node]
            bars = [
                [f"order {task.number}", one.made / max(1, one.batch), f"{one.made} of {one.batch}"]
                for task, one in row.items()
                if one.lathe_phase is not LathePhase.QUEUED
            ]
            for tool in lathe.tools:
                used = self._worn.get((node, tool.number))
                if used is not None:
                    share = used / (tool.life_min * 60_000)
                    bars.append([f"T{tool.number:02d} worn", min(1.0, share), f"{share:.0%}"])
            lines = [self._line(node, task, one) for task, one in row.items()] or ["no order"]
            mode = self._modes.get(node)
            marks[f"m{node}"] = {
                "lines": [*([f"control {mode.name.lower()}"] if mode is not None else []), *lines[:4]],
                "bars": bars[:5],
            }
        return {"marks": marks, "things": []}

    def _line(self, node: int, task: Reference, one: LatheProgress) -> str:
        price = self._seen.prices.get((node, task))
        cost = f", {price / 100:.2f} a part" if price is not None else ""
        return f"{self.words.thing(task)}: {one.lathe_phase.name.lower().replace('_', ' ')}{cost}"


SCENE = TurningScene
