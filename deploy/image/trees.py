"""Device trees for the boards, and overlays for their CAN HATs, which the board's firmware lays over them.

Debian's 6.1 trees carry no symbols, so an overlay would find nothing in them by name; the one that ours need is
written in.
"""

from pathlib import Path

from deploy.image.apt import run_tool

HATS = Path(__file__).with_name("hats")
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
    """Compile every HAT's overlay. Raises ``DeployError``."""
    to.mkdir(parents=True, exist_ok=True)
    made = []
    for source in sorted(HATS.glob("*.dts")):
        overlay = to / f"{source.stem}.dtbo"
        run_tool(["dtc", "-@", "-q", "-I", "dts", "-O", "dtb", "-o", str(overlay), str(source)])
        made.append(overlay)
    return made
