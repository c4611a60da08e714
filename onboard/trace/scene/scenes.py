"""Which scene draws which system: the one place to add one. A system without its own has its machines' table only."""

from onboard.core.messages import Message, Reference
from onboard.core.site import Site
from onboard.systems.car_park.scene import CarParkScene
from onboard.systems.cell.scene import CellScene
from onboard.systems.cell.site import Cell
from onboard.systems.graph.scene import GraphScene
from onboard.systems.graph.site import FactoryGraph
from onboard.systems.mapd.scene import MapdScene
from onboard.systems.mapd.site import Mapd
from onboard.systems.terminal.scene import TerminalScene
from onboard.systems.terminal.site import Terminal
from onboard.systems.turning.scene import TurningScene
from onboard.systems.turning.site import Turning
from onboard.trace.scene.scene import Json, Scene
from onboard.trace.view import SiteView


class PlainScene:
    """A system that nobody has drawn: its calls, bids and events are told all the same."""

    noun = "task"

    def layout(self) -> Json:
        """An empty plan."""
        return {"plan": {"width": 1000, "height": 60, "shapes": []}}

    def feed(self, message: Message, time_us: int) -> None:
        """As in the port."""

    def feed_device(self, node: int, message: Message, time_us: int) -> None:
        """As in the port."""

    def machine(self, node: int, now_us: int) -> Json:
        """As in the port."""
        return {"where": "", "car": None}

    def marks(self, now_us: int) -> Json:
        """As in the port."""
        return {"marks": {}, "things": []}

    def thing(self, reference: Reference) -> str:
        """As in the port."""
        return f"task {reference.number}"

    def place(self, number: int) -> str:
        """As in the port."""
        return f"place {number}"

    def task_end(self, reference: Reference, station: int) -> str:
        """As in the port."""
        return f"has done task {reference.number}"


def scene_of(site: Site, view: SiteView) -> Scene:
    """The scene of a site, to be fed beside ``view``."""
    match site:
        case Terminal():
            return TerminalScene(site, view)
        case FactoryGraph():
            return GraphScene(site, view)
        case Cell():
            return CellScene(site, view)
        case Mapd():
            return MapdScene(site, view)
        case Turning():
            return TurningScene(site, view)
    return CarParkScene(site, view) if site.tracks else PlainScene()
