"""The site file of a car park, of floors, alleys, lifts and compartments; docs/site-file.md describes every key."""

from dataclasses import replace

from onboard.config.reader import Common, TomlTable
from onboard.config.timing import read_timing
from onboard.contract.codes import KindCode
from onboard.systems.car_park.reader.alleys import read_layout
from onboard.systems.car_park.reader.battery import check_chargers, read_battery
from onboard.systems.car_park.reader.built import only_tracks
from onboard.systems.car_park.reader.classes import check_heights, read_classes
from onboard.systems.car_park.reader.constants import check_lobbies, read_constants
from onboard.systems.car_park.reader.machines import Bay, read_fleet, read_stewards
from onboard.systems.car_park.reader.positions import BASE
from onboard.systems.car_park.reader.whole import check_whole, sound_tracks
from onboard.systems.car_park.site import CallAt, CarPark, DeskPolicy, PlacePolicy, RestAt, RideCalls
from onboard.ways.site import BayUse, charted


def read(root: TomlTable, common: Common) -> CarPark:
    """A car park; every mistake is noted in ``root.problems``, and raised as ``ConfigError``.

    What is proved of the whole is told with them, as far as it does not follow from them.
    """
    lifts, lift = root.tables("lifts"), root.table("lift")
    floor_height_mm = lift.integer("floor_height_mm", 1000, 10_000, 2_500)
    layout = read_layout(root, lifts, floor_height_mm)
    fleet, bays = read_fleet(root, layout)
    stewards = read_stewards(root.table("stewards"), layout, fleet)
    constants = read_constants(root, lift, min(track.pitch_mm for track in layout.alleys()))
    check_lobbies(lifts, constants.carrier_length_mm)
    classes, place_class = read_classes(root, layout, constants)
    check_heights(layout, constants.cars, classes, place_class)
    robots = sum(1 for machine in fleet.by_node.values() if machine.kind is KindCode.ROBOT)
    timing = read_timing(root.table("timing"), robots, len(fleet.by_node), common.bitrate)
    negotiation = root.table("negotiation")
    rides = RideCalls(negotiation.choice("rides", [one.value for one in RideCalls], "planned"))
    call_at = CallAt(negotiation.choice("call_at", [one.value for one in CallAt], "arrival"))
    rest_at = RestAt(negotiation.choice("rest_at", [one.value for one in RestAt], "nearest"))
    desk = DeskPolicy(negotiation.choice("desk", [one.value for one in DeskPolicy], _desk(bays)))
    place = PlacePolicy(negotiation.choice("place", [one.value for one in PlacePolicy], "nearest"))
    quiet_moves = negotiation.flag("quiet_moves", default=False)
    tells_offers = negotiation.choice("offers", ["kept", "told"], "kept") == "told"
    promises = negotiation.flag("promises", default=False)
    power = root.table("battery")
    battery = read_battery(power, layout, [home for _, home in fleet.robots])
    timing = replace(timing, sub_call_percent=negotiation.integer("sub_call_percent", 20, 80, 50))
    root.check_unknown()
    sound = sound_tracks(root, layout)
    site = CarPark(
        name=common.name,
        digest=0,
        bitrate=common.bitrate,
        tracks=charted({number: track for number, track in layout.tracks.items() if number in sound}),
        places=layout.places(),
        machines=dict(sorted((fleet.by_node | fleet.odd).items())),
        stewards=stewards,
        carrier=constants.carrier,
        carrier_length_mm=constants.carrier_length_mm,
        carrier_clearance_mm=constants.carrier_clearance_mm,
        carrier_turn_us=constants.carrier_turn_us,
        shuttle=constants.shuttle,
        shuttle_reach_mm=constants.shuttle_reach_mm,
        lift=constants.lift,
        floor_height_mm=floor_height_mm,
        cars=constants.cars,
        timing=timing,
        rides=rides,
        call_at=call_at,
        rest_at=rest_at,
        desk=desk,
        place=place,
        quiet_moves=quiet_moves,
        tells_offers=tells_offers,
        promises=promises,
        bay_uses={bay.node: bay.use for bay in bays if bay.use is not BayUse.BOTH},
        classes=classes,
        place_class=place_class,
        battery=battery,
        alley_names={number: name for (_, name), number in layout.named.items() if name != BASE},
    )
    site = check_whole(root, layout, only_tracks(site, sound), fleet, bays, crowded=common.crowded)
    if battery is not None and not root.problems.found and not common.crowded:
        check_chargers(power, site, battery)
    root.problems.raise_if_any()
    return site


def _desk(bays: list[Bay]) -> str:
    """To which bay a car comes where nothing is said: to the one that suits it, where each is for cars in and out.

    Waits are shorter by a tenth to two fifths so. Where another is for cars out only, the nearest for most is the one
    at which others come in, and waits are longer (docs/figures.md).
    """
    all_alike = len(bays) > 1 and all(bay.use is BayUse.BOTH for bay in bays)
    return "nearest" if all_alike else "any"
