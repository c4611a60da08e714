"""The scene that a site's system draws. A system without its own has its machines' table only."""

from onboard.contract.messages import Message
from onboard.core.site import Site
from onboard.history.history import Fact
from onboard.systems.registry import part
from onboard.trace.scene.scene import Json, Scene
from onboard.trace.view import SiteView


class PlainScene:
    """A system that nobody has drawn: its calls, bids and events are told all the same."""

    def layout(self) -> Json:
        """An empty plan, 1000 x 60: nobody has said how to draw this system."""
        return {"plan": {"width": 1000, "height": 60, "shapes": []}}

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """Nothing is drawn, so no message changes anything."""

    def feed_device(self, node: int, message: Message, time_us: int) -> None:
        """Nothing is drawn, so no message changes anything."""

    def machine(self, node: int, now_us: int) -> Json:
        """No place and no load: neither can be read without the system's own messages."""
        return {"where": "", "car": None}

    def marks(self, now_us: int) -> Json:
        """No marks and no things on an empty plan."""
        return {"marks": {}, "things": []}


def scene_of(site: Site, view: SiteView) -> Scene:
    """The scene of a site, to be fed beside ``view``."""
    module = part(site.system, "scene")
    if module is None:
        return PlainScene()
    scene: Scene = module.SCENE(site, view)
    return scene
