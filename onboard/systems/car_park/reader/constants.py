"""Speeds, lengths and limits of a car park's site file.

Default speeds are those of a SimPy simulation study of automated car parks (carrier 90 m/min, shuttle 45 m/min,
lift 65 m/min, places of 2.4 m by 5.4 m, 2.5 m a level). Accelerations, clearances and limits of cars
are plausible, and measured nowhere.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from onboard.config.reader import TomlTable
from onboard.systems.car_park.site import CarLimits
from onboard.ways.site import Axis


@dataclass(frozen=True, slots=True)
class Constants:
    """What moves how fast, how large it is, and what cars are taken."""

    carrier: Axis
    carrier_length_mm: int
    carrier_clearance_mm: int
    carrier_turn_us: int
    shuttle: Axis
    shuttle_reach_mm: int
    lift: Axis
    cars: CarLimits


def read_constants(root: TomlTable, lift: TomlTable, pitch_mm: int) -> Constants:
    """``[carrier]``, ``[shuttle]``, ``[cars]``, and the speeds of ``[lift]``."""
    carrier, shuttle, cars = (root.table(name) for name in ("carrier", "shuttle", "cars"))
    length_mm = carrier.integer("length_mm", 100, 10_000, min(2_300, pitch_mm - 100))
    if length_mm > pitch_mm:
        carrier.bad("length_mm", length_mm, f"longer than a segment ({pitch_mm} mm)", "make floors.pitch_mm larger")
    return Constants(
        _read_axis(carrier, 1_500, 500),
        length_mm,
        carrier.integer("clearance_mm", 0, 20_000, 50),
        carrier.integer("turn_ms", 0, 60_000, 3_000) * 1000,
        _read_axis(shuttle, 750, 500),
        shuttle.integer("reach_mm", 500, 8_000, 5_400),
        _read_axis(lift, 1_083, 500),
        _read_cars(cars, length_mm),
    )


def _read_axis(table: TomlTable, speed_mm_s: int, acceleration_mm_s2: int) -> Axis:
    return Axis(
        table.integer("speed_mm_s", 10, 20_000, speed_mm_s),
        table.integer("acceleration_mm_s2", 10, 20_000, acceleration_mm_s2),
    )


def check_width(table: TomlTable, carrier_length_mm: int) -> None:
    """Note cars that stand out over their carrier: others come as near to it as its own length allows."""
    most_mm = table.values.get("max_width_mm", 0)
    if "max_width_mm" not in table.wrong and most_mm > carrier_length_mm:
        what = f"wider than a carrier is long along the alley ({carrier_length_mm} mm)"
        table.bad("max_width_mm", most_mm, what, "make it smaller, or carrier.length_mm and the pitches larger")


def check_lobbies(lifts: Iterable[TomlTable], carrier_length_mm: int) -> None:
    """Note lobbies in which a carrier would stand in the door of the shaft, and in the alley."""
    for table in lifts:
        lobby_mm = table.values.get("lobby_mm", carrier_length_mm)
        if "lobby_mm" not in table.wrong and lobby_mm < carrier_length_mm:
            what = f"shorter than a carrier ({carrier_length_mm} mm)"
            table.bad("lobby_mm", lobby_mm, what, "make it larger, or carrier.length_mm smaller")


def _read_cars(table: TomlTable, carrier_length_mm: int) -> CarLimits:
    """The wheelbases that the bus can carry (8 bits of 10 mm from 1500 mm) bound what a site can take."""
    limits = CarLimits(
        table.integer("min_wheelbase_mm", 1510, 4050, 1_800),
        table.integer("max_wheelbase_mm", 1510, 4050, 3_400),
        table.integer("max_length_mm", 1000, 8000, 5_300),
        table.integer("max_height_mm", 500, 4000, 2_100),
        table.integer("max_load_kg", 100, 4000, 3_000),
        table.integer("max_width_mm", 1000, 4000, 0),
    )
    check_width(table, carrier_length_mm)
    low_mm, high_mm = limits.min_wheelbase_mm, limits.max_wheelbase_mm
    if low_mm > high_mm and not table.wrong:
        name = "min_wheelbase_mm" if "min_wheelbase_mm" in table.values else "max_wheelbase_mm"
        what = f"min_wheelbase_mm {low_mm} is above max_wheelbase_mm {high_mm}"
        table.bad(name, table.values[name], what, "make the range the right way round")
    return limits
