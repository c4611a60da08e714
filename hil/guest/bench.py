"""The bench in the guest: makes both buses of the device, then runs the scenarios beside it. Runs in the guest.

``python -m hil.guest.bench SHARE [PYTEST'S OPTIONS]`` leaves ``report.xml`` and the traces in ``SHARE``.
"""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

from hil.guest.initrd import WORK
from hil.guest.mesh import Mesh, inside, join_pair

#: The device's namespace and the fleet's; the third node acknowledges, and is where a person would listen.
DEVICE, FLEET, TOOLS = "MR1", "fleet", "tools"
#: The device's own files, in the guest's memory, as it writes a journal; ``$HOME/board`` to benches/guest.toml.
BOARD = Path(WORK) / "board"
BENCH = Path(__file__).parents[1] / "benches" / "guest.toml"


def main(words: Sequence[str]) -> None:
    """Make the buses, and become pytest in the fleet's namespace."""
    share, *options = words
    BOARD.mkdir(parents=True)
    Mesh([DEVICE, FLEET, TOOLS])
    join_pair(FLEET, f"d{DEVICE}", DEVICE, "can1")
    os.environ["PYTHON"] = sys.executable
    # What is installed beside pytest and not used here takes the emulated processor seconds to load.
    os.environ["PYTEST_DISABLE_PLUGIN_AUTOLOAD"] = "1"
    hil = Path(__file__).parents[1]
    os.chdir(hil.parent)
    command = [sys.executable, "-m", "pytest", str(hil), "-p", "pytest_asyncio.plugin", "-p", "no:cacheprovider", "-q"]
    report = [f"--bench={BENCH}", f"--junitxml={share}/report.xml", f"--traces={share}/traces"]
    all_words = [*inside(FLEET), *command, *report, *options]
    os.execvp(all_words[0], all_words)


if __name__ == "__main__":
    main(sys.argv[1:])
