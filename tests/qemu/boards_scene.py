"""Level 1 with one robot over emulated CAN controllers with their real driver. Run by ``test_socketcan_boards.py``."""

import json
import sys

from hil.guest.listener import CandumpListener
from hil.guest.mesh import run
from hil.guest.site_run import TOOLS, SiteRun, play


def scene(site: SiteRun) -> dict[str, object]:
    bitrate: int = json.loads((site.share / "plan.json").read_text())["bitrate"]
    site.prepare()
    site.connect_boards(bitrate)
    site.record()
    listener = CandumpListener(TOOLS)
    site.start_machines()
    site.start_plant()
    site.wait(
        listener, "frames of both machines", lambda: {frame[6:8] for frame in listener.frames} >= {"01", "0B"}, 60
    )
    status = site.statuses(["plant"], 200)
    site.tell("the plant's run is over")
    links = {name: json.loads(run("ip", "-n", name, "-j", "-d", "-s", "link", "show", "can0"))[0] for name in (
        *site.order.machines, TOOLS
    )}  # fmt: skip
    status |= site.end(site.order.machines)
    return {"status": status, "links": links}


if __name__ == "__main__":
    sys.exit(play(scene))
