"""The small park in the guest, with the tools that people use beside it. Run there by ``test_socketcan_park.py``."""

import json
import sys
import time

from hil.guest.listener import CandumpListener
from hil.guest.mesh import inside
from hil.guest.site_run import TOOLS, SiteRun, play

#: The machine that is unplugged, until another one has been heard so often.
UNPLUGGED, WITNESS, AWAY_BEATS = "MR2", "ER1", 4
#: As many lines of the recording are played again.
REPLAYED = 200


def scene(site: SiteRun) -> dict[str, object]:
    plan = json.loads((site.share / "plan.json").read_text())
    beats: dict[str, str] = plan["heartbeats"]
    site.prepare()
    mesh = site.connect()
    site.tell("the bus is there")
    site.record()
    site.record_outside()
    listener = CandumpListener(TOOLS)
    site.start_machines()
    site.start_plant()

    def count(name: str) -> int:
        return sum(frame.startswith(beats[name]) for frame in listener.frames)

    site.wait(listener, "all machines' heartbeats", lambda: all(count(name) for name in beats), 60)
    site.start("monitor", [*inside(TOOLS), *plan["monitor"]], "monitor.txt")
    site.wait(listener, f"{UNPLUGGED} is steady", lambda: count(UNPLUGGED) >= 3, 30)
    mesh.unplug(UNPLUGGED)
    out, heard = [time.time()], count(WITNESS)
    site.wait(listener, f"{UNPLUGGED} is away", lambda: count(WITNESS) >= heard + AWAY_BEATS, 30)
    before = count(UNPLUGGED)
    out.append(time.time())
    mesh.plug(UNPLUGGED)
    site.wait(listener, f"{UNPLUGGED} is heard again", lambda: count(UNPLUGGED) > before, 30)

    asked_at = len(listener.read())
    site.tool("cansend", "can0", plan["ask"])
    answer = plan["answer"]
    site.wait(
        listener, "an answer to cansend", lambda: any(f.startswith(answer) for f in listener.frames[asked_at:]), 20
    )

    status = site.statuses(["plant"], 150)
    site.tell("the plant's run is over")
    stopped_at = len(listener.read())
    site.tool("cansend", "can0", plan["stop"])
    held: dict[str, str] = plan["held"]
    everybody = "everybody holds, and says so"
    site.wait(listener, everybody, lambda: set(held.values()) <= set(listener.frames[stopped_at:]), 20)
    status |= site.end(site.order.machines)
    site.end(["candump", "candump-outside", "monitor"])

    part = site.share / "part.log"
    part.write_text("".join((site.share / "fleet.log").read_text().splitlines(keepends=True)[:REPLAYED]))
    other = CandumpListener(UNPLUGGED)
    site.tool("canplayer", "-I", str(part), "-g", "5", "-t", "can0=can0")
    site.wait(other, "canplayer's frames", lambda: len(other.frames) >= REPLAYED, 20)
    return {"status": status, "unplugged": out, "replayed": other.frames}


if __name__ == "__main__":
    sys.exit(play(scene))
