"""An openTCS plant model (XML, as model version 7.0.0 writes it) as a network of one-way lines.

Points and paths become points and lines, blocks for a single vehicle become zones, locations endpoints. Steps are as
long as two vehicles, so that robots in neighbouring cells keep a vehicle's length between them.
"""

from pathlib import Path

from bus_sim.systems.mapd.importers.draft import Draft, Loss, draw_tasks, machine_name
from bus_sim.systems.mapd.importers.mapf import DrawnDemand
from bus_sim.systems.mapd.importers.xml_tree import XmlElement, parse_xml
from onboard.config.problems import Problems, nearest
from onboard.systems.mapd.floor import NetworkLine, network_floor
from onboard.systems.mapd.reader import MAX_STEPS
from onboard.ways.rests import lasting_rests

_LONGEST_MM = 10_000_000


class OpenTcsModel:
    """The elements of a model that are well formed; every mistake is noted."""

    def __init__(self, root: XmlElement, problems: Problems) -> None:
        self.problems = problems
        self.points = self._named(root, "point")
        self.paths = self._named(root, "path")
        self.vehicles = self._named(root, "vehicle")
        self.locations = self._named(root, "location")
        self.types = self._named(root, "locationType")
        self.blocks = self._named(root, "block")
        for name, point in self.points.items():
            if ">" in name:
                problems.add(point.line, "point name", name, "has a >, which joins names here", "name it without >")
        for path in self.paths.values():
            for end in ("sourcePoint", "destinationPoint"):
                self.refer(path, end, self.points)
        for location in self.locations.values():
            self.refer(location, "type", self.types)
            for link in location.all("link"):
                self.refer(link, "point", self.points)

    def text(self, element: XmlElement, name: str) -> str:
        """An attribute that must be there."""
        value = element.attributes.get(name, "")
        if not value:
            self.problems.add(element.line, f"{element.name} {name}", None, "missing", "export the model again")
        return value

    def integer(self, element: XmlElement, name: str, low: int) -> int:
        """A whole number of an attribute from ``low`` on; ``low`` where it is none."""
        value = self.text(element, name)
        try:
            number = round(float(value))
        except (ValueError, OverflowError):
            number = low - 1
        if value and not low <= number <= _LONGEST_MM:
            words = f"write a number from {low} to {_LONGEST_MM}"
            self.problems.add(element.line, f"{element.name} {name}", value, "out of range", words)
        return max(number, low)

    def refer(self, element: XmlElement, name: str, known: dict[str, XmlElement]) -> None:
        """Note an attribute that names nothing known."""
        value = self.text(element, name)
        if value and value not in known:
            remedy = nearest(value, sorted(known)[:12])
            self.problems.add(element.line, f"{element.name} {name}", value, "names nothing in the model", remedy)

    def _named(self, root: XmlElement, kind: str) -> dict[str, XmlElement]:
        found: dict[str, XmlElement] = {}
        for element in root.all(kind):
            name = self.text(element, "name")
            if name in found:
                self.problems.add(element.line, f"{kind} name", name, "used twice", "give each a name of its own")
            elif name:
                found[name] = element
        return found


def import_opentcs(path: Path, text: str, wanted: DrawnDemand) -> Draft:
    """A site of a plant model. Raises ``ConfigError`` with every mistake."""
    problems = Problems(str(path))
    root = parse_xml(text, problems)
    if root is not None and root.name != "model":
        problems.add(root.line, root.name, None, "not a plant model", "give an XML file whose root is <model>")
    problems.raise_if_any()
    assert root is not None
    model = OpenTcsModel(root, problems)
    for kind, what in (("vehicle", model.vehicles), ("path", model.paths)):
        if not what:
            problems.add(root.line, kind, None, f"no {kind}", f"a site needs at least one <{kind}>")
    problems.raise_if_any()
    name = machine_name(root.attributes.get("name", "") or path.stem, ())
    draft = Draft(name, [f"{path.name} (openTCS model {root.attributes.get('version', 'without version')})"])
    length_mm = max(_vehicle_length(model, one) for one in model.vehicles.values())
    speed_mm_s = min(model.integer(one, "maxVelocity", 1) for one in model.vehicles.values())
    draft.step_ms = max(100, -(-2 * length_mm * 1000 // speed_mm_s))
    draft.points = list(model.points)
    _add_lines(model, draft, speed_mm_s)
    _add_zones(model, draft)
    _add_endpoints(model, draft)
    problems.raise_if_any()
    _add_robots(model, draft, wanted)
    problems.raise_if_any()
    draft.tasks = draw_tasks(draft.endpoints, wanted.tasks, wanted.every, wanted.seed)
    draft.meanings.append(f"openTCS models hold no transport orders: drawn with seed {wanted.seed}.")
    _note_losses(model, root, draft)
    return draft


def _vehicle_length(model: OpenTcsModel, vehicle: XmlElement) -> int:
    boxes = vehicle.all("boundingBox")
    return model.integer(boxes[0] if boxes else vehicle, "length", 1)


def _add_lines(model: OpenTcsModel, draft: Draft, speed_mm_s: int) -> None:
    """A line for each path that is not locked, as long as the slower of path and vehicle takes on it."""
    for name, path in model.paths.items():
        start, end = path.attributes["sourcePoint"], path.attributes["destinationPoint"]
        if path.attributes.get("locked") == "true":
            draft.losses.append(Loss(f"path {name}", "locked in the model"))
            continue
        if start == end or any({one.start, one.end} == {start, end} and one.start == start for one in draft.lines):
            draft.losses.append(Loss(f"path {name}", "from a point to itself, or a second one between the same points"))
            continue
        forward, reverse = (model.integer(path, key, 0) for key in ("maxVelocity", "maxReverseVelocity"))
        speed = min(speed_mm_s, forward) or speed_mm_s
        steps = max(1, round(model.integer(path, "length", 1) * 1000 / speed / draft.step_ms))
        if steps > MAX_STEPS:
            model.problems.add(path.line, "path length", path.attributes["length"], "too long", "cut the path in two")
            steps = MAX_STEPS
        if forward:
            draft.lines.append(NetworkLine(start, end, steps, one_way=not reverse))
        elif reverse:
            draft.lines.append(NetworkLine(end, start, steps, one_way=True))


def _add_zones(model: OpenTcsModel, draft: Draft) -> None:
    lines = {f"{one.start}>{one.end}" for one in draft.lines}
    for name, block in model.blocks.items():
        kind = block.attributes.get("type", "")
        if kind != "SINGLE_VEHICLE_ONLY":
            draft.losses.append(Loss(f"block {name}", f"type {kind or 'unknown'}; only SINGLE_VEHICLE_ONLY is known"))
            continue
        members = []
        for member in block.all("member"):
            one = model.text(member, "name")
            path = model.paths.get(one)
            line = f"{path.attributes['sourcePoint']}>{path.attributes['destinationPoint']}" if path else one
            if line in lines or line in model.points:
                members.append(line)
            elif one in model.locations or path is not None:
                draft.losses.append(Loss(f"member {one} of block {name}", "not a line of the site"))
            else:
                model.problems.add(member.line, "member name", one, "names nothing in the model", "take it out")
        if members:
            draft.zones.append(members)


def _add_endpoints(model: OpenTcsModel, draft: Draft) -> None:
    """The points of locations at which something other than charging can be done."""
    for name, location in model.locations.items():
        kind = location.attributes["type"]
        operations = [one.attributes.get("name", "") for one in model.types[kind].all("allowedOperation")]
        work = [one for one in operations if one not in {"NOP", "CHARGE"}]
        links = [one.attributes["point"] for one in location.all("link")]
        if not links or not work:
            why = "no point is linked to it" if not links else "nothing is done there but charging"
            draft.losses.append(Loss(f"location {name}", why))
            continue
        draft.losses.append(Loss(f"operations {', '.join(work)} at location {name}", "a task is pick-up and delivery"))
        for link in links:
            draft.meanings.append(f"{link}: location {name} ({kind})")
            if link not in draft.endpoints:
                draft.endpoints.append(link)


def _add_robots(model: OpenTcsModel, draft: Draft, wanted: DrawnDemand) -> None:
    """Homes at parking positions, then at other points in which a vehicle shuts nobody in."""
    floor = network_floor(draft.points, draft.lines, draft.zones)
    number = {name: cell for cell, name in enumerate(floor.names)}
    parking = [name for name, one in model.points.items() if one.attributes.get("type") == "PARK_POSITION"]
    others = [name for name in draft.points if name not in parking and name not in draft.endpoints]
    cells = [number[name] for name in [*parking, *others]]
    rests = lasting_rests(floor.network, cells, [number[name] for name in draft.endpoints])
    homes = [floor.names[cell] for cell in cells if cell in rests]
    vehicles = list(model.vehicles)[: wanted.robots]
    if len(homes) < len(vehicles):
        what = f"vehicles may stay in {len(homes)} points without shutting others in"
        model.problems.add(0, "vehicle", len(vehicles), what, "import fewer (--robots), or add points beside the ways")
        return
    for vehicle, home in zip(vehicles, homes, strict=False):
        name = machine_name(vehicle, [one for one, _ in draft.robots])
        draft.robots.append((name, home))
        draft.meanings.append(f"{name}: vehicle {vehicle}; models hold no start, so it begins in {home}")
    for name in parking:
        if number[name] not in rests:
            draft.losses.append(Loss(f"parking position {name}", "who stays there for ever shuts others in"))


def _note_losses(model: OpenTcsModel, root: XmlElement, draft: Draft) -> None:
    for name, vehicle in model.vehicles.items():
        if "energyLevelCritical" in vehicle.attributes:
            draft.losses.append(Loss(f"energy levels of vehicle {name}", "robots do not run empty"))
        if vehicle.all("property"):
            draft.losses.append(Loss(f"properties of vehicle {name}", "meant for its driver software"))
    for name, path in model.paths.items():
        for operation in path.all("peripheralOperation"):
            what = f"{operation.attributes.get('name', '')} {operation.attributes.get('locationName', '')}"
            draft.losses.append(Loss(f"peripheral operation {what} on path {name}", "no such device on the site"))
        if path.all("vehicleEnvelope"):
            draft.losses.append(Loss(f"envelopes of path {name}", "a cell is as wide as a robot"))
    for name, point in model.points.items():
        if point.all("vehicleEnvelope"):
            draft.losses.append(Loss(f"envelopes of point {name}", "a cell is as wide as a robot"))
    for layout in root.all("visualLayout"):
        draft.losses.append(Loss(f"visual layout {layout.attributes.get('name', '')}", "positions are not drawn"))
