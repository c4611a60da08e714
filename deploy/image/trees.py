"""Device trees for the boards, and overlays for their CAN HATs, which the board's firmware lays over them.

Debian's 6.1 trees carry no symbols, so an overlay would find nothing in them by name; the one that ours need is
written in.
"""

from collections.abc import Iterable
from pathlib import Path

from deploy.image.apt import run_tool
from deploy.image.config_txt import merged
from deploy.image.hats import names, overlay_source

#: What our overlays name, and where the trees of all boards have it (Linux arch/arm/boot/dts/bcm283x.dtsi).
_NAME, _PLACE = "gpio", "/soc/gpio@7e200000"


def write_tree(tree: Path, to: Path) -> Path:
    """Copy a board's tree, with the symbol. Raises ``DeployError`` where it has no such place."""
    to.write_bytes(tree.read_bytes())
    run_tool(["fdtget", "-p", str(to), _PLACE])
    run_tool(["fdtput", "-c", str(to), "/__symbols__"])
    run_tool(["fdtput", "-t", "s", str(to), "/__symbols__", _NAME, _PLACE])
    return to


def write_overlays(to: Path) -> list[Path]:
    """Compile the overlay of every HAT that is known. Raises ``DeployError``."""
    to.mkdir(parents=True, exist_ok=True)
    made = []
    for name in names():
        source, overlay = to / f"{name}.dts", to / f"{name}.dtbo"
        source.write_text(overlay_source(name), encoding="utf-8")
        run_tool(["dtc", "-@", "-q", "-I", "dts", "-O", "dtb", "-o", str(overlay), str(source)])
        source.unlink()
        made.append(overlay)
    return made


def check_config(config: str, trees: Iterable[Path], overlays: Path) -> None:
    """Raise ``DeployError`` where the overlays of a ``config.txt`` do not fit one of the trees."""
    for tree in trees:
        merged(config, tree, overlays)
