"""The scene that a site's system draws. A system without its own has its machines' table only."""

from onboard.core.messages import Message
from onboard.core.site import Site
from onboard.systems.registry import part
from onboard.trace.scene.scene import Json, Scene
from onboard.trace.view import SiteView


class PlainScene:
    """A system that nobody has drawn: its calls, bids and events are told all the same."""

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


def scene_of(site: Site, view: SiteView) -> Scene:
    """The scene of a site, to be fed beside ``view``."""
    module = part(site.system, "scene")
    if module is None:
        return PlainScene()
    scene: Scene = module.SCENE(site, view)
    return scene
