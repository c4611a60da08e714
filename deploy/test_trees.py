"""CAN HATs on the trees of real boards: every overlay merges, and what it refers to is there."""

from pathlib import Path

import pytest

from deploy.image.config_txt import merged
from deploy.image.debian import fetch_debian
from deploy.image.trees import write_overlays, write_tree

#: Makers' lines, and how many controllers they bring.
LINES = {
    "dtoverlay=mcp2515-can0,oscillator=12000000,interrupt=25,spimaxfrequency=2000000": 1,
    "dtoverlay=mcp2515-can1,oscillator=8000000,interrupt=25\ndtoverlay=mcp2515-can0,interrupt=23": 2,
    "dtoverlay=mcp2515,spi1-0,interrupt=22": 1,
    "dtoverlay=mcp251xfd,spi0-0,interrupt=25\ndtoverlay=mcp251xfd,spi1-0,interrupt=24": 2,
    "dtoverlay=seeed-can-fd-hat-v1": 2,
    "dtoverlay=seeed-can-fd-hat-v2": 2,
}


@pytest.mark.parametrize("lines", LINES)
def test_a_makers_lines_on_every_board(lines: str, tmp_path: Path) -> None:
    write_overlays(tmp_path / "overlays")
    trees = sorted(fetch_debian().kernel.rglob("*.dtb"))
    assert any("bcm2711" in tree.name for tree in trees) and any("bcm2837" in tree.name for tree in trees)
    for tree in trees:
        root = merged(lines, write_tree(tree, tmp_path / tree.name), tmp_path / "overlays")
        handles = {one.cells("phandle")[0] for _, one in root.walk() if "phandle" in one.properties}
        buses = [root.at(f"/soc/{bus}") for bus in ("spi@7e204000", "spi@7e215080")]
        chips = [chip for bus in buses for name, chip in bus.children.items() if name.startswith("mcp")]
        assert len(chips) == LINES[lines], tree.name
        for node in [*chips, *(bus for bus in buses if bus.text("status") == "okay")]:
            assert set(node.cells("pinctrl-0")) <= handles, tree.name
        for chip in chips:
            assert set(chip.cells("clocks")) <= handles, tree.name
