"""What a root file system says of itself, and whose updates it takes."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field

import onboard
from deploy.update.manifest import BOARD

#: Folder in the root file system.
PLACE = "etc/onboard"


@dataclass(frozen=True, slots=True)
class Release:
    """Version of a root file system, and the public keys (PEM, one after another) of its updates; none, no updates.

    ``extra`` are further files in it by name, for a board that needs some.
    """

    version: str = onboard.__version__
    key: bytes = b""
    extra: Mapping[str, bytes] = field(default_factory=dict)

    def files(self) -> dict[str, bytes]:
        """Its files in the root file system."""
        said = json.dumps({"board": BOARD, "version": self.version}, sort_keys=True) + "\n"
        return {f"{PLACE}/release.json": said.encode(), f"{PLACE}/update.pem": self.key, **self.extra}
