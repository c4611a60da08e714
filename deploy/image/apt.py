"""The build host's own apt, for another architecture: its mirrors and its way to them, lists and packages apart."""

import os
import re
import subprocess
from collections.abc import Sequence
from pathlib import Path

from deploy.image.needs import BASE_PACKAGES, PACKAGES
from deploy.wheels import DeployError

ARCHITECTURE = "arm64"
SUITE = "bookworm"
_BUILD_S = 3_600
#: apt's settings that decide whether a mirror can be reached. Its hooks stay on the host.
_TRANSPORT = re.compile(r"Acquire::(https?|ftp|tor|Check-|Retries|Force|Proxy|AllowInsecure)", re.IGNORECASE)


class Apt:
    """apt with lists and packages of its own below a folder. Raises ``DeployError`` where it fails."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for part in ("lists/partial", "cache/archives/partial"):
            (folder / part).mkdir(parents=True, exist_ok=True)

    def run(self, tool: str, *words: str) -> str:
        """What a tool of apt's said."""
        settings = {
            "APT::Architecture": ARCHITECTURE,
            "APT::Architectures": ARCHITECTURE,
            "Dir::State::Lists": str(self.folder / "lists"),
            "Dir::State::status": "/dev/null",
            "Dir::Cache": str(self.folder / "cache"),
            "APT::Sandbox::User": "",
            "Debug::NoLocking": "1",
        }
        options = [word for name, value in settings.items() for word in ("-o", f"{name}={value}")]
        return run_tool([tool, *options, *words], self.folder)

    def mirrors(self) -> list[str]:
        """What the host's own apt takes Debian's packages of our suite from, as lines of a list without ``deb``."""
        form = "$(ORIGIN)|$(CODENAME)|$(REPO_URI) $(RELEASE) $(COMPONENT)"
        said = self.run("apt-get", "indextargets", "--format", form, "Created-By: Packages").splitlines()
        found = [line.split("|", 2) for line in said]
        lines = [where for origin, name, where in found if origin == "Debian" and name.startswith(SUITE)]
        if not lines:
            raise DeployError(f"apt knows no mirror of Debian {SUITE}; is this a Debian {SUITE} host?")
        return lines

    def transport(self) -> str:
        """How the host's own apt fetches: proxies, certificates, what it does about old lists."""
        said = self.run("apt-config", "dump", "--format", '%F "%v";%n', "Acquire").splitlines()
        return "".join(f"{line}\n" for line in said if _TRANSPORT.match(line) and not line.endswith(' "";'))


def run_tool(words: Sequence[str], folder: Path | None = None, source: Path | None = None, **environment: str) -> str:
    """What a tool said; it runs with the system's own folders in its path, and reads ``source``.

    Raises ``DeployError``.
    """
    path = f"{os.environ.get('PATH', '')}:/usr/sbin:/sbin"
    try:
        with (source or Path(os.devnull)).open("rb") as given:
            done = subprocess.run(
                words,
                cwd=folder,
                env={**os.environ, "PATH": path, **environment},
                stdin=given,
                capture_output=True,
                text=True,
                timeout=_BUILD_S,
                check=False,
            )
    except FileNotFoundError:
        package = {**PACKAGES, **BASE_PACKAGES}.get(words[0], words[0])
        raise DeployError(f"{words[0]} is not installed (apt-get install {package})") from None
    if done.returncode:
        # The last line is often a summary; the reason stands before it.
        last = done.stderr.strip().splitlines()[-2:] or ["it said nothing"]
        raise DeployError(f"{words[0]}: {'; '.join(last)}")
    return done.stdout
