"""What a board loads to run a machine of any system: nothing that only reads DBC texts or logs."""

import subprocess
import sys

import pytest

from onboard.systems.registry import own_names

LOADED = """
import sys
import onboard.cli
from onboard.systems.registry import find_system, part
from onboard.wire.codec import codecs
name = sys.argv[1]
find_system(name), part(name, "reader")
frames = part(name, "frames")
codecs(frames.FRAMES if frames else ())
print(*sys.modules)
"""
#: Each with all below it.
NEVER = (
    *("aiomqtt", "can", "cantools", "onboard.contract.generate", "onboard.gateway.gateway", "onboard.operate"),
    *("onboard.trace", "onboard.web.app", "onboard.wire.dbc_file"),
)


@pytest.mark.parametrize("system", own_names())
def test_a_board_loads_no_reader_of_dbc_texts_or_logs_and_no_other_system(system: str) -> None:
    done = subprocess.run([sys.executable, "-c", LOADED, system], capture_output=True, text=True, check=True)
    loaded = done.stdout.split()
    assert "onboard.wire.codec" in loaded
    assert not [name for name in loaded if name.startswith(tuple(f"{one}." for one in NEVER)) or name in NEVER]
    others = tuple(f"onboard.systems.{name.replace('-', '_')}." for name in own_names() if name != system)
    assert not [name for name in loaded if name.startswith(others)]
