"""Programs of others that tests run: found, or the test is skipped by the program's name."""

import os
import shutil
import subprocess

import pytest

#: What installs a tool where it is missing (Debian, Ubuntu).
PACKAGES = {
    "asc2log": "can-utils",
    "candump": "can-utils",
    "gcc": "gcc libc6-dev",
    "mosquitto": "mosquitto",
    "mosquitto_pub": "mosquitto-clients",
    "mosquitto_sub": "mosquitto-clients",
    "node": "nodejs",
    "openssl": "openssl",
    "spin": "spin",
    "canplayer": "can-utils",
    "log2asc": "can-utils",
    "log2long": "can-utils",
    "rsvg-convert": "librsvg2-bin",
    "tshark": "tshark",
}
#: How long something that other programs do may take, s: the one deadline of all tests, met only by what hangs, however
#: busy the machine is; tests wait on events.
DEADLINE_S = 240.0


def require_tool(name: str) -> str:
    """The path of a program. Skips the test where it is missing, or fails it where ``REQUIRE=all`` forbids a skip."""
    # A daemon is where only root looks by itself.
    path = shutil.which(name) or shutil.which(name, path="/usr/sbin:/sbin")
    if path is not None:
        return path
    why = f"{name} is not installed (apt-get install {PACKAGES.get(name, name)})"
    if os.environ.get("REQUIRE") == "all":
        pytest.fail(why)
    pytest.skip(why)


def run_tool(*command: str, stdin: bytes = b"") -> str:
    """Run a program to its end; its standard output. Fails the test, showing what it said, where it fails."""
    done = subprocess.run(command, input=stdin, capture_output=True, timeout=DEADLINE_S, check=False)
    if done.returncode:
        pytest.fail(f"{' '.join(command)}: exit status {done.returncode}\n{done.stderr.decode(errors='replace')}")
    return done.stdout.decode()
