"""Device tree overlays for common CAN HATs, under the names and with the parameters of the Raspberry Pi kernel's own.

So the line that a HAT's maker prints for ``config.txt`` works on our image. Debian's kernel has no such overlays, and
its trees know less by name, so these enable the buses, with their pins, themselves (BCM2835 ARM Peripherals, 6.2).
Parameters are applied by the board's firmware (the format: Raspberry Pi documentation, "Device Trees, overlays, and
parameters"); ``config_txt`` does the same here.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple


class SpiBus(NamedTuple):
    """An SPI bus: its node, its pins and their function, the pins of its chip selects."""

    node: str
    pins: str
    function: int
    selects: tuple[int, ...]


#: BCM2835: ALT0 is function 4, ALT4 function 3, an output 1.
BUSES = (
    SpiBus("/soc/spi@7e204000", "9 10 11", 4, (8, 7)),
    SpiBus("/soc/spi@7e215080", "19 20 21", 3, (18,)),
)
_I2C1 = "/soc/i2c@7e804000"


class Chip(NamedTuple):
    """A CAN controller: the kernel's name, its crystal and its SPI clock, Hz; what makers mostly build in."""

    name: str
    crystal_hz: int
    spi_hz: int


MCP2515 = Chip("mcp2515", 16_000_000, 10_000_000)
MCP251XFD = Chip("mcp251xfd", 40_000_000, 20_000_000)


class HatPosition(NamedTuple):
    """Where a controller sits: SPI bus, chip select, and the pin of its interrupt."""

    bus: int
    select: int
    interrupt: int


@dataclass(frozen=True, slots=True)
class Hat:
    """One overlay. ``speed`` is what its parameter for the SPI clock is called; ``choices`` are other places for it."""

    chip: Chip
    places: tuple[HatPosition, ...]
    speed: str = ""
    choices: tuple[HatPosition, ...] = ()
    #: Real-time clock on I2C1: the kernel's name and the address.
    clock: tuple[str, int] | None = None


_ANYWHERE = (HatPosition(0, 0, 25), HatPosition(0, 1, 25), HatPosition(1, 0, 25))
#: Names, parameters and pins: Raspberry Pi kernel, arch/arm/boot/dts/overlays/README.
HATS = {
    "mcp2515-can0": Hat(MCP2515, (HatPosition(0, 0, 25),), "spimaxfrequency"),
    "mcp2515-can1": Hat(MCP2515, (HatPosition(0, 1, 25),), "spimaxfrequency"),
    "mcp2515": Hat(MCP2515, (HatPosition(0, 0, 25),), "speed", _ANYWHERE),
    "mcp251xfd": Hat(MCP251XFD, (HatPosition(0, 0, 25),), "speed", _ANYWHERE),
    "seeed-can-fd-hat-v1": Hat(MCP251XFD, (HatPosition(0, 0, 25), HatPosition(1, 0, 24))),
    "seeed-can-fd-hat-v2": Hat(MCP251XFD, (HatPosition(0, 0, 25), HatPosition(0, 1, 24)), clock=("nxp,pcf85063", 0x51)),
}


#: The overlay for real-time clocks on I2C1, and the chips that are its parameters: the kernel's name and the address.
RTC = "i2c-rtc"
_CLOCKS = {
    "ds1307": ("dallas,ds1307", 0x68),
    "ds3231": ("maxim,ds3231", 0x68),
    "pcf8523": ("nxp,pcf8523", 0x68),
    "pcf8563": ("nxp,pcf8563", 0x51),
    "pcf85063": ("nxp,pcf85063", 0x51),
}


def names() -> Sequence[str]:
    """All overlays that there are."""
    return [*HATS, RTC]


def overlay_source(name: str) -> str:
    """The overlay of this name as source for ``dtc -@``."""
    if name == RTC:
        return _clock_source()
    hat = HATS[name]
    used = sorted({place.bus for place in hat.places + hat.choices})
    on = {place.bus for place in hat.places}
    fragments = [part for number in used for part in _bus(name, number, is_on=number in on)]
    for place in hat.places:
        fragments += _controller(hat.chip, place)
    if hat.clock is not None:
        fragments.append(_clock(*hat.clock))
    body = "\n".join(f"{_DEVICE if one.is_device and hat.choices else ''}fragment@{number} {{ {one.text} }};"
                     for number, one in enumerate(fragments))  # fmt: skip
    params = "\n".join(f"{key} = {', '.join(what)};" for key, what in _overrides(hat, used).items())
    end = f"__overrides__ {{\n{params}\n}};" if params else ""
    return f'/dts-v1/;\n/plugin/;\n/ {{\ncompatible = "brcm,bcm2835";\n{body}\n{end}\n}};\n'


class _Fragment(NamedTuple):
    text: str
    #: That of the controller itself, which a parameter may put onto another bus.
    is_device: bool = False


#: Label of that fragment, where there is one controller.
_DEVICE = "device: "
_CELLS = '#address-cells = <1>; #size-cells = <0>; status = "okay";'


def _bus(name: str, number: int, *, is_on: bool) -> list[_Fragment]:
    """Pins and bus; both sleep where no controller sits there until a parameter chooses this bus.

    Names are this overlay's own, and the pins never come without their bus: where a second overlay had a node of the
    same name, the references of the first one to it would lead nowhere.
    """
    bus, own = BUSES[number], f"{name.replace('-', '_')}_spi{number}"
    selects = ", ".join(f"<&gpio {pin} 1>" for pin in bus.selects)
    numbers = " ".join(str(pin) for pin in bus.selects)
    state = "__overlay__" if is_on else "__dormant__"
    data = f"{own}_pins: {own}_pins {{ brcm,pins = <{bus.pins}>; brcm,function = <{bus.function}>; }};"
    cs = f"{own}_cs_pins: {own}_cs_pins {{ brcm,pins = <{numbers}>; brcm,function = <1>; }};"
    pins = f'pinctrl-names = "default"; pinctrl-0 = <&{own}_pins &{own}_cs_pins>;'
    return [
        _Fragment(f"target = <&gpio>; {state} {{ {data} {cs} }};"),
        _Fragment(f'target-path = "{bus.node}"; {state} {{ {_CELLS} cs-gpios = {selects}; {pins} }};'),
    ]


def _controller(chip: Chip, place: HatPosition) -> list[_Fragment]:
    key = f"can{place.bus}{place.select}"
    named = _named(chip, place)
    crystal = f'compatible = "fixed-clock"; #clock-cells = <0>; clock-frequency = <{chip.crystal_hz}>;'
    pins = f"brcm,pins = <{place.interrupt}>; brcm,function = <0>;"
    # 8: a low level (IRQ_TYPE_LEVEL_LOW), as both chips hold their pin down until all is read.
    values = f'compatible = "microchip,{chip.name}"; reg = <{place.select}>; clocks = <&{key}_osc>;'
    values += f" spi-max-frequency = <{chip.spi_hz}>; interrupt-parent = <&gpio>; interrupts = <{place.interrupt} 8>;"
    values += f' pinctrl-names = "default"; pinctrl-0 = <&{key}_pins>;'
    device = f"{key}: {chip.name}@{place.select} {{ {values} }};"
    return [
        _Fragment(f'target-path = "/"; __overlay__ {{ {key}_osc: {named}-osc {{ {crystal} }}; }};'),
        _Fragment(f"target = <&gpio>; __overlay__ {{ {key}_pins: {named}-pins {{ {pins} }}; }};"),
        _Fragment(f'target-path = "{BUSES[place.bus].node}"; __overlay__ {{ {device} }};', is_device=True),
    ]


def _clock(chip: str, address: int) -> _Fragment:
    node = f'rtc@{address:x} {{ compatible = "{chip}"; reg = <{address:#x}>; }};'
    return _Fragment(f'target-path = "{_I2C1}"; __overlay__ {{ {_CELLS} {node} }};')


def _clock_source() -> str:
    """Each clock sleeps until its parameter wakes it."""
    texts = [_clock(*clock).text.replace("__overlay__", "__dormant__") for clock in _CLOCKS.values()]
    body = "\n".join(f"fragment@{number} {{ {text} }};" for number, text in enumerate(texts))
    params = "\n".join(f'{name} = <0>, "+{number}";' for number, name in enumerate(_CLOCKS))
    return f'/dts-v1/;\n/plugin/;\n/ {{\ncompatible = "brcm,bcm2835";\n{body}\n__overrides__ {{\n{params}\n}};\n}};\n'


def _overrides(hat: Hat, used: Sequence[int]) -> dict[str, list[str]]:
    """What each parameter changes; see the firmware's documentation for the words."""
    if not hat.speed:
        return {}
    key = f"can{hat.places[0].bus}{hat.places[0].select}"
    found = {
        "oscillator": [f"<&{key}_osc>", '"clock-frequency:0"'],
        hat.speed: [f"<&{key}>", '"spi-max-frequency:0"'],
        "interrupt": [f"<&{key}_pins>", '"brcm,pins:0"', f"<&{key}>", '"interrupts:0"'],
    }
    for place in hat.choices:
        named = _named(hat.chip, place)
        buses = "".join(
            f"{'+' if number == place.bus else '-'}{2 * index}{'+' if number == place.bus else '-'}{2 * index + 1}"
            for index, number in enumerate(used)
        )
        found[f"spi{place.bus}-{place.select}"] = [
            *("<0>", f'"{buses}"'),
            *("<&device>", f'"target-path={BUSES[place.bus].node}"'),
            *(f"<&{key}>", f'"reg:0={place.select}"'),
            *(f"<&{key}_osc>", f'"name={named}-osc"'),
            *(f"<&{key}_pins>", f'"name={named}-pins"'),
        ]
    return found


def _named(chip: Chip, place: HatPosition) -> str:
    return f"{chip.name}-spi{place.bus}-{place.select}"
