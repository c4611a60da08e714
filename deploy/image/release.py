"""What a root file system says of itself, and whose updates it takes."""

import json
from dataclasses import dataclass

import onboard
from deploy.update.manifest import BOARD

#: Folder in the root file system.
PLACE = "etc/onboard"


@dataclass(frozen=True, slots=True)
class Release:
    """Version of a root file system, and the public key (PEM) of its updates; without one it takes none."""

    version: str = onboard.__version__
    key: bytes = b""

    def files(self) -> dict[str, bytes]:
        """Its files in the root file system."""
        said = json.dumps({"board": BOARD, "version": self.version}, sort_keys=True) + "\n"
        return {f"{PLACE}/release.json": said.encode(), f"{PLACE}/update.pem": self.key}
