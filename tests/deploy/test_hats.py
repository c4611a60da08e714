"""Overlays of CAN HATs: their parameters, and the tree that a kernel gets. Real trees: ``deploy/test_trees.py``."""

from pathlib import Path

import pytest

from deploy.image.config_txt import merged, overlays_of
from deploy.image.fdt import DeviceTreeNode, read_tree, write_tree
from deploy.image.hats import HATS
from deploy.image.layer import FILES
from deploy.image.trees import check_config, write_overlays
from deploy.wheels import DeployError
from tests.tools import require_tool, run_tool

#: As much of a board's tree as overlays touch, by the names and places of Linux' bcm283x.dtsi.
BASE = """\
/dts-v1/;
/ {
    compatible = "raspberrypi,none";
    soc {
        #address-cells = <1>;
        #size-cells = <1>;
        gpio: gpio@7e200000 { #gpio-cells = <2>; #interrupt-cells = <2>; gpio-controller; interrupt-controller; };
        spi@7e204000 { status = "disabled"; };
        spi@7e215080 { status = "disabled"; };
        i2c@7e804000 { status = "disabled"; };
    };
};
"""
SPI0, SPI1 = "/soc/spi@7e204000", "/soc/spi@7e215080"


@pytest.fixture(scope="module")
def overlays(tmp_path_factory: pytest.TempPathFactory) -> Path:
    require_tool("dtc")
    folder = tmp_path_factory.mktemp("overlays")
    write_overlays(folder)
    return folder


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    require_tool("dtc")
    folder = tmp_path_factory.mktemp("tree")
    (folder / "board.dts").write_text(BASE)
    run_tool("dtc", "-@", "-q", "-O", "dtb", "-o", str(folder / "board.dtb"), str(folder / "board.dts"))
    return folder / "board.dtb"


def referred(root: DeviceTreeNode, node: DeviceTreeNode, name: str) -> list[DeviceTreeNode]:
    """The nodes that a property of handles names; each must be there."""
    by_handle = {one.cells("phandle")[0]: one for _, one in root.walk() if "phandle" in one.properties}
    return [by_handle[handle] for handle in node.cells(name)]


def told(root: DeviceTreeNode, bus: str, controller: str) -> tuple[str, int, int, int, int]:
    """Chip, select, interrupt pin, crystal and SPI clock, as the kernel's driver finds them; its pins agree."""
    node = root.at(f"{bus}/{controller}")
    (crystal,) = referred(root, node, "clocks")
    (pins,) = referred(root, node, "pinctrl-0")
    interrupt, level = node.cells("interrupts")
    assert pins.cells("brcm,pins") == [interrupt] and level == 8
    (hz,) = crystal.cells("clock-frequency")
    (select,) = node.cells("reg")
    return node.text("compatible"), select, interrupt, hz, node.cells("spi-max-frequency")[0]


def pins_of(root: DeviceTreeNode, bus: str) -> list[int]:
    """The pins of a bus that is on."""
    node = root.at(bus)
    assert node.text("status") == "okay"
    return sorted(pin for one in referred(root, node, "pinctrl-0") for pin in one.cells("brcm,pins"))


def test_a_makers_line_with_every_parameter(overlays: Path, tree: Path) -> None:
    """Of a HAT with one MCP2515 and a crystal of 12 MHz, as its maker prints it."""
    line = "dtparam=spi=on\ndtoverlay=mcp2515-can0,oscillator=12000000,interrupt=24,spimaxfrequency=2000000  # CAN\n"
    root = merged(line, tree, overlays)
    assert told(root, SPI0, "mcp2515@0") == ("microchip,mcp2515", 0, 24, 12_000_000, 2_000_000)
    assert pins_of(root, SPI0) == [7, 8, 9, 10, 11]
    assert root.at(SPI1).text("status") == "disabled"


def test_two_controllers_of_two_overlays_on_one_bus(overlays: Path, tree: Path) -> None:
    """The image's own lines; the second overlay must not break what the first one refers to."""
    root = merged((FILES / "config.txt").read_text(encoding="utf-8"), tree, overlays)
    assert told(root, SPI0, "mcp2515@0") == ("microchip,mcp2515", 0, 23, 16_000_000, 10_000_000)
    assert told(root, SPI0, "mcp2515@1") == ("microchip,mcp2515", 1, 25, 16_000_000, 10_000_000)
    assert pins_of(root, SPI0) == [7, 8, 9, 10, 11]


@pytest.mark.parametrize(
    ("lines", "places"),
    [
        (
            "mcp251xfd,spi0-0,interrupt=25 mcp251xfd,spi1-0,interrupt=24,speed=9000000",
            [(SPI0, 0, 25), (SPI1, 0, 24)],
        ),
        ("mcp251xfd,spi0-0 mcp251xfd,spi0-1,interrupt=13", [(SPI0, 0, 25), (SPI0, 1, 13)]),
        ("seeed-can-fd-hat-v1", [(SPI0, 0, 25), (SPI1, 0, 24)]),
        ("seeed-can-fd-hat-v2", [(SPI0, 0, 25), (SPI0, 1, 24)]),
    ],
)
def test_hats_with_two_controllers(lines: str, places: list[tuple[str, int, int]], overlays: Path, tree: Path) -> None:
    root = merged("".join(f"dtoverlay={line}\n" for line in lines.split()), tree, overlays)
    for bus, select, interrupt in places:
        found = told(root, bus, f"mcp251xfd@{select}")
        assert found[:3] == ("microchip,mcp251xfd", select, interrupt)
    assert pins_of(root, SPI0) == [7, 8, 9, 10, 11]
    if any(bus == SPI1 for bus, _, _ in places):
        assert pins_of(root, SPI1) == [18, 19, 20, 21]
    if "v2" in lines:
        assert root.at("/soc/i2c@7e804000/rtc@51").text("compatible") == "nxp,pcf85063"


def test_a_real_time_clock_by_its_chip(overlays: Path, tree: Path) -> None:
    root = merged("dtoverlay=i2c-rtc,ds3231", tree, overlays)
    bus = root.at("/soc/i2c@7e804000")
    assert bus.text("status") == "okay"
    assert {name: node.text("compatible") for name, node in bus.children.items()} == {"rtc@68": "maxim,ds3231"}


def test_a_bus_that_nobody_chose_stays_as_it_was(overlays: Path, tree: Path) -> None:
    root = merged("dtoverlay=mcp2515,spi1-0,speed=5000000", tree, overlays)
    assert root.at(SPI0).text("status") == "disabled"
    assert told(root, SPI1, "mcp2515@0")[4] == 5_000_000


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("dtoverlay=mcp2515-can2", "no such overlay; known: i2c-rtc, mcp2515, mcp2515-can0"),
        ("dtoverlay=mcp2515-can0,osc=8000000", "no such parameter; known: interrupt, oscillator, spimaxfrequency"),
        ("dtoverlay=seeed-can-fd-hat-v1,speed=1", "no such parameter; known: none"),
    ],
)
def test_a_mistake_is_told_before_anything_is_flashed(line: str, why: str, overlays: Path, tree: Path) -> None:
    with pytest.raises(DeployError, match=why):
        check_config(line, [tree], overlays)


def test_lines_of_other_things_are_passed_over() -> None:
    text = "# dtoverlay=no\n[pi4]\ndtoverlay=vc4-kms-v3d\narm_64bit=1\ndtoverlay = mcp251xfd , spi0-0\n"
    assert overlays_of(text)[0] == ("vc4-kms-v3d", {})


def test_a_tree_is_written_as_it_was_read(tree: Path) -> None:
    assert read_tree(write_tree(read_tree(tree.read_bytes()))) == read_tree(tree.read_bytes())
    for broken in (b"", b"\0" * 64, tree.read_bytes()[:100]):
        with pytest.raises(DeployError, match="device tree"):
            read_tree(broken)


def test_the_kernels_names_are_all_there() -> None:
    assert set(HATS) == {
        *("mcp2515", "mcp2515-can0", "mcp2515-can1", "mcp251xfd", "seeed-can-fd-hat-v1", "seeed-can-fd-hat-v2")
    }
