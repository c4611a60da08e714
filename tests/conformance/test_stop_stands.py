"""After an emergency stop whatever drives comes to stand, in every system, and goes on when the stop is over.

What is gripped, lifted or put down then is ended; a robot in step ends the cell into which it has set off.
"""

from pathlib import Path

import pytest

from bus_sim.cli import main
from onboard.contract.cell_device import ArmState
from onboard.contract.device import DriveState
from onboard.contract.graph_device import BodyState
from onboard.contract.mapd_device import CartState
from onboard.contract.messages import EmergencyStop, Message
from onboard.contract.terminal_device import MoveState
from onboard.contract.turning_device import NcState
from onboard.trace.listener import Listener
from onboard.trace.readers.open_log import Log
from tests.conformance.cases import CASES
from tests.conformance.runs import site_file, site_of
from tests.web.logs import contract

#: What says where something is, or what it is at.
DRIVES = (ArmState, BodyState, CartState, DriveState, MoveState, NcState)
#: A stop holds until this long after it was last heard, s (protocol [H1]); a control stands 2.5 s after its last order,
#: and a robot with a car brakes for as long.
HOLDS_S, STANDS_S = 30, 4
#: When it is pressed, s: something drives then.
MOMENTS = {
    "car-park": (14, 30, 86),
    "cell": (18, 36, 45),
    "graph": (21, 24, 30),
    "mapd": (12, 16),
    "terminal": (12, 20, 40),
    "turning": (60, 300, 700),
}


def words_of(system: str, at_s: int, folder: Path) -> list[tuple[float, Message]]:
    """What drives say in a run in which everything is stopped at ``at_s``, with times after the stop, s."""
    log, listener = folder / "run.log", Listener(contract(site_of(system)))
    words = [*CASES[system].moving, "--for", str(at_s + HOLDS_S + 20), "--speed", "max", "--no-web", "--devices"]
    fault = f"emergency_stop:at_s={at_s}"
    main(["run", site_file(system), *words, "--trace", str(log), "--fault", fault])
    with Log(str(log)) as lines:
        heard = [(raw.time_us / 1e6, listener.hear(raw).message) for raw in lines]
    stop_s = next(time_s for time_s, message in heard if isinstance(message, EmergencyStop))
    return [(time_s - stop_s, message) for time_s, message in heard if isinstance(message, DRIVES)]


def changes(words: list[tuple[float, Message]], from_s: float, to_s: float) -> list[Message]:
    """What differs from the word before of the same device, within a span of time."""
    last: dict[int, Message] = {}
    found = []
    for time_s, word in words:
        if word != last.get(word.sender) and from_s <= time_s < to_s:
            found.append(word)
        last[word.sender] = word
    return found


@pytest.mark.parametrize(
    ("system", "at_s"), [(system, at_s) for system, moments in MOMENTS.items() for at_s in moments]
)
def test_what_drives_stands_until_the_stop_is_over_and_goes_on_then(system: str, at_s: int, tmp_path: Path) -> None:
    words = words_of(system, at_s, tmp_path)
    assert changes(words, STANDS_S, HOLDS_S) == []
    assert changes(words, 0, STANDS_S), "something was moving"
    assert changes(words, HOLDS_S, HOLDS_S + 20), "it goes on"
