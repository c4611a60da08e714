"""Classes of places: how long, high, heavy and wide a car may be that is put there, and where one can charge."""

from onboard.config.reader import TomlTable
from onboard.core.site import Station
from onboard.systems.car_park.reader.constants import Constants, check_width
from onboard.systems.car_park.reader.layout import Layout
from onboard.systems.car_park.reader.positions import read_written
from onboard.systems.car_park.site import CarLimits, SizeClass

#: A class is said on the bus in four bits, 0 for none.
_MOST_CLASSES = 15


def read_classes(root: TomlTable, layout: Layout, constants: Constants) -> tuple[tuple[SizeClass, ...], dict[int, int]]:
    """``[[classes]]`` in the file's order, and the class of each place that has one: its number from 1 by station."""
    tables, cars = root.tables("classes"), constants.cars
    if len(tables) > _MOST_CLASSES:
        tables[-1].bad("name", None, f"{len(tables)} classes", f"a site has at most {_MOST_CLASSES}")
    classes: list[SizeClass] = []
    of_place: dict[int, int] = {}
    for number, table in enumerate(tables, start=1):
        name = table.text("name")
        if name in [one.name for one in classes]:
            table.bad("name", name, "used twice", "give each class a name of its own")
        one = SizeClass(
            name,
            table.integer("max_length_mm", 1000, 8000, cars.max_length_mm),
            table.integer("max_height_mm", 500, 4000, cars.max_height_mm),
            table.integer("max_load_kg", 100, 4000, cars.max_load_kg),
            table.flag("charging", default=False),
            table.integer("max_width_mm", 1000, 4000, cars.max_width_mm),
        )
        for limit in ("max_length_mm", "max_height_mm", "max_load_kg", "max_width_mm"):
            most = getattr(cars, limit)
            if most and getattr(one, limit) > most and limit not in table.wrong:
                table.bad(
                    limit, getattr(one, limit), f"no such car comes in: cars.{limit} is {most}", "make one of both fit"
                )
        check_width(table, constants.carrier_length_mm)
        classes.append(one)
        _read_places(layout, table, number, of_place, classes)
    return tuple(classes), of_place


def _read_places(
    layout: Layout, table: TomlTable, number: int, of_place: dict[int, int], classes: list[SizeClass]
) -> None:
    """Give the places of one class its number; each place has one at most."""
    there = set(layout.places())
    found, all_sure = 0, layout.known
    for item, text in enumerate(table.items("places", 'a list of places such as ["p(*,1-4)F"]') or ()):
        written = read_written(text)
        if written is None:
            table.bad("places", text, "not a place", 'write places such as "p(1,3)N" or "p(*,1-4)"', item=item)
            continue
        is_sure = layout.can_judge(written)
        named = layout.stations(written) if is_sure else set()
        meant = named & there
        all_sure = all_sure and is_sure
        if is_sure and not meant:
            what, remedy = ("no such place", layout.extent()) if not named else _gone(layout, min(named))
            table.bad("places", text, what, remedy, item=item)
        for station in sorted(meant):
            other = of_place.setdefault(station.number, number)
            if other != number:
                table.bad("places", text, f"{station} is of class {classes[other - 1].name}", "name it once", item=item)
                break
        found += len(meant)
    if not found and all_sure and "places" not in table.wrong:
        table.bad("places", table.values.get("places"), "no place of this class", 'write places such as "p(*,1-4)F"')


def _gone(layout: Layout, station: Station) -> tuple[str, str]:
    """Why there is no place where there could be one, and what to do."""
    there = layout.taken.get(station)
    what = f"{there} is there" if there is not None else "left out by floors.without"
    return what, "name other places, or take it out of the list"


def check_heights(layout: Layout, cars: CarLimits, classes: tuple[SizeClass, ...], place_class: dict[int, int]) -> None:
    """Note floors that tell their height, and are no higher than cars that may be put there."""
    for floor, table in layout.low.items():
        height_mm = table.values["height_mm"]
        for place in layout.places() if layout.known else ():
            number = place_class.get(place.number, 0)
            most_mm = classes[number - 1].max_height_mm if number else cars.max_height_mm
            if layout.level[place.track] == floor and most_mm >= height_mm:
                what = f"cars up to {most_mm} mm high may be put into {place}"
                table.bad("height_mm", height_mm, what, "put its places into a class of lower cars, or make it higher")
                break
