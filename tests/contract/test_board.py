"""What a board loads to run a machine of any system: nothing that only reads DBC texts or logs."""

import subprocess
import sys
from pathlib import Path

import pytest

import bus_sim
from onboard.systems.registry import own_names

SITE = Path(bus_sim.__file__).parent / "sites" / "level1.toml"
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
#: A controller's start as far as its files, then what was left out is asked for after all.
STARTED = """
import sys
from onboard.__main__ import main
assert main(["--machine", sys.argv[1], "--check"]) == 0
print(*sys.modules)
import ssl, asyncio, hashlib
ssl.create_default_context()
"""


@pytest.mark.parametrize("system", own_names())
def test_a_board_loads_no_reader_of_dbc_texts_or_logs_and_no_other_system(system: str) -> None:
    done = subprocess.run([sys.executable, "-c", LOADED, system], capture_output=True, text=True, check=True)
    loaded = done.stdout.split()
    assert "onboard.wire.codec" in loaded
    assert not [name for name in loaded if name.startswith(tuple(f"{one}." for one in NEVER)) or name in NEVER]
    others = tuple(f"onboard.systems.{name.replace('-', '_')}." for name in own_names() if name != system)
    assert not [name for name in loaded if name.startswith(others)]


def test_a_controller_without_a_broker_loads_no_openssl_and_others_still_can(tmp_path: Path) -> None:
    machine = tmp_path / "mr1.toml"
    bus = 'interface = "virtual"\nchannel = "MR1"\n'
    text = f'[machine]\nname = "MR1"\nsite = "{SITE}"\n[fleet_bus]\n{bus}[device_bus]\n{bus}'
    machine.write_text(text, encoding="utf-8")
    done = subprocess.run([sys.executable, "-c", STARTED, machine], capture_output=True, text=True, check=True)
    loaded = done.stdout.splitlines()[1].split()
    assert {"asyncio", "hashlib"} <= set(loaded)
    assert "ssl" not in loaded
    assert "_hashlib" not in loaded or {"_sha2", "_sha256"}.isdisjoint(sys.builtin_module_names)
