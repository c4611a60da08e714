"""What a board does before each start of its controller: settings of interfaces only where they can be others."""

import os
import subprocess
from pathlib import Path

from deploy.package import FILES

SYSTEM = ("/boot/onboard", "/run/onboard-network.made", "/run/systemd/network", "/usr/lib/onboard", "/usr/bin/onboard")


def test_settings_are_made_once_and_again_after_a_change(tmp_path: Path) -> None:
    text = (FILES / "network").read_text()
    for place in SYSTEM:
        assert place in text
        text = text.replace(place, f"{tmp_path}{place}")
        (tmp_path / place[1:]).parent.mkdir(parents=True, exist_ok=True)
    machine = tmp_path / "boot/onboard/machine.toml"
    machine.parent.mkdir()
    machine.write_text("one")
    for name, place in (("onboard", "usr/bin/onboard"), ("networkctl", "bin/networkctl")):
        program = tmp_path / place
        program.parent.mkdir(parents=True, exist_ok=True)
        program.write_text(f'#!/bin/sh\necho "{name} $*" >>{tmp_path}/calls\n')
        program.chmod(0o755)

    def started() -> int:
        environment = {**os.environ, "PATH": f"{tmp_path}/bin:{os.environ['PATH']}"}
        subprocess.run(["sh", "-c", text], env=environment, check=True)
        return len((tmp_path / "calls").read_text().splitlines())

    assert started() == 2, "made, and networkd told"
    made = f"onboard --machine {machine} --networkd {tmp_path}/run/systemd/network"
    assert (tmp_path / "calls").read_text().splitlines() == [made, "networkctl reload"]
    assert started() == 2, "a controller that is started again is one program"
    machine.write_text("two")
    assert started() == 4
