"""Sizes of cars as a table gives them, and where a car of a size fits."""

from collections.abc import Sequence
from dataclasses import replace

from bus_sim.systems.car_park.csv_rows import CsvRow
from bus_sim.systems.car_park.moments import CellError
from bus_sim.systems.car_park.plant.bodies import CarBody, random_car
from onboard.systems.car_park.site import ANY_CLASS, NO_CLASS, CarPark, SizeClass

#: Columns of a car's size and what they may hold, mm and kg: at most what the bay's sensors can say (dbc/device.dbc).
RANGES = {
    "length_mm": (1000, 8191),
    "width_mm": (500, 4000),
    "height_mm": (300, 4095),
    "weight_kg": (50, 4095),
    "wheelbase_mm": (500, 8191),
}
COLUMNS = (*RANGES, "class", "charging")
#: What a cell of ``charging`` may say; an empty one says no.
_ASKS = {"1": True, "true": True, "yes": True, "0": False, "false": False, "no": False}


def car_of(name: str, row: CsvRow, seed: int, park: CarPark | None) -> CarBody:
    """The car of a row.

    What the row does not say is as its class allows at most, else drawn for an ordinary car of the length that it says.
    Raises ``CellError`` for a size out of range, a class that the site does not have, and a car that is wider than all
    places where no gate measures that.
    """
    given = {name: row.number(name, *span) for name, span in RANGES.items() if name in row.cells}
    wide_mm = max((park.tracks[place.track].pitch_mm for place in park.places), default=0) if park is not None else 0
    if park is not None and not park.measures_width and given.get("width_mm", 0) > wide_mm:
        what = f"width_mm {row.cells['width_mm']!r} is wider than every place of {park.name}, {wide_mm} mm"
        raise CellError(f"{what}, and no gate measures it; correct or leave out the row")
    classes = park.classes if park is not None else ()
    one = _class_named(row.cells["class"], classes) if "class" in row.cells and classes else None
    drawn = random_car(name, seed)
    length_mm = given.get("length_mm", drawn.length_mm if one is None else one.max_length_mm)
    if length_mm != drawn.length_mm:
        drawn = _of_length(drawn, length_mm)
    if one is not None:
        drawn = replace(drawn, height_mm=one.max_height_mm, mass_kg=one.max_load_kg, charging=one.charging)
        drawn = replace(drawn, width_mm=one.max_width_mm or drawn.width_mm)
    return replace(
        drawn,
        width_mm=given.get("width_mm", drawn.width_mm),
        height_mm=given.get("height_mm", drawn.height_mm),
        mass_kg=given.get("weight_kg", drawn.mass_kg),
        wheelbase_mm=given.get("wheelbase_mm", drawn.wheelbase_mm),
        charging=_asks(row) if "charging" in row.cells else drawn.charging,
    )


def _asks(row: CsvRow) -> bool:
    text = row.cells["charging"]
    if text.casefold() not in _ASKS:
        raise CellError(f"charging {text!r}: write yes or no")
    return _ASKS[text.casefold()]


def _of_length(car: CarBody, length_mm: int) -> CarBody:
    """The same car, longer or shorter: wheelbase and weight in proportion."""
    wheelbase_mm = round(car.wheelbase_mm * length_mm / car.length_mm)
    mass_kg = round(car.mass_kg * length_mm / car.length_mm)
    return replace(car, length_mm=length_mm, wheelbase_mm=wheelbase_mm, mass_kg=mass_kg)


def _class_named(name: str, classes: Sequence[SizeClass]) -> SizeClass:
    for one in classes:
        if one.name.casefold() == name.casefold():
            return one
    raise CellError(f"class {name!r}: the site has {', '.join(one.name for one in classes)}; write one of them")


def misfits(cars: Sequence[CarBody], park: CarPark) -> list[str]:
    """A line for each car that the gate will refuse: which limits of the site it breaks."""
    found = [(car, broken_limits(car, park)) for car in cars]
    return [f"{car.name} fits nowhere: {'; '.join(broken)}" for car, broken in found if broken]


def broken_limits(car: CarBody, park: CarPark) -> list[str]:
    """The limits of a site that a car breaks, in words; none where some place takes it (row P33)."""
    limits = park.cars
    spans = (
        ("length", car.length_mm, 0, limits.max_length_mm, "mm"),
        ("height", car.height_mm, 0, limits.max_height_mm, "mm"),
        ("width", car.width_mm, 0, limits.max_width_mm or car.width_mm, "mm"),
        ("wheelbase", car.wheelbase_mm, limits.min_wheelbase_mm, limits.max_wheelbase_mm, "mm"),
        ("weight", car.mass_kg, 0, limits.max_load_kg, "kg"),
    )
    broken = [
        f"{what} {value} {unit}, at {'least' if value < low else 'most'} {low if value < low else high}"
        for what, value, low, high, unit in spans
        if not low <= value <= high
    ]
    number = park.car_class(car.length_mm, car.height_mm, car.mass_kg, car.width_mm, charging=car.charging)
    if not broken and not any(park.takes(place, number) for place in park.places):
        sizes = f"length {car.length_mm} mm, height {car.height_mm} mm, weight {car.mass_kg} kg"
        sizes += f", width {car.width_mm} mm" if park.measures_width else ""
        none = number in (ANY_CLASS, NO_CLASS)
        mine = "of no class" if none else f"of class {park.classes[number - 1].name}"
        mine += " where one can charge" if number == NO_CLASS else ""
        broken = [f"{sizes} is {mine}, and no place takes it"]
    return broken
