"""The settings by which systemd-networkd brings a machine's CAN interfaces up (systemd.network(5), section CAN)."""

from collections.abc import Iterable
from pathlib import Path

from onboard.io.settings import Interface

#: The kernel tries again so long after bus-off; the controller hears of it and waits for its own bus time anyhow.
RESTART_MS = 100


def network_files(interfaces: Iterable[Interface]) -> dict[str, str]:
    """Name and text of one ``.network`` file for each SocketCAN interface; other interfaces need none."""
    wanted = {one.channel: one.bitrate for one in interfaces if one.interface == "socketcan"}
    return {
        f"80-onboard-{channel}.network": (
            f"[Match]\nName={channel}\n\n[CAN]\nBitRate={bitrate}\nRestartSec={RESTART_MS}ms\n"
        )
        for channel, bitrate in wanted.items()
    }


def write_network_files(interfaces: Iterable[Interface], to: Path) -> list[Path]:
    """Write them into a folder that networkd reads, such as /run/systemd/network. Raises ``OSError``."""
    to.mkdir(parents=True, exist_ok=True)
    written = []
    for name, text in network_files(interfaces).items():
        (to / name).write_text(text, encoding="utf-8")
        written.append(to / name)
    return written
