"""The ground truth of a terminal: bodies in slots, boxes, obstacles; and the oracle that looks at nothing else."""

from dataclasses import dataclass, field

from onboard.systems.terminal.site import EntityKind, StationKind, Terminal


@dataclass
class VehicleBody:
    """One vehicle: the slot that it is in, the one that it is moving into, and what it carries."""

    node_id: int
    entity: int
    slot: int
    came_from: int = 0
    target: tuple[int, int] | None = None
    box: int = 0
    docked: bool = False


@dataclass(frozen=True, slots=True)
class BoxHandling:
    """A box picked up or put down: loop time in us."""

    time_us: int
    vehicle: int
    box: int
    station: int
    is_up: bool


@dataclass
class TerminalWorld:
    """Bodies, boxes and obstacles. Whatever must never happen is kept in ``violations``, word for word."""

    site: Terminal
    bodies: dict[int, VehicleBody] = field(default_factory=dict)
    standing: dict[int, list[int]] = field(default_factory=dict)
    blocked: set[int] = field(default_factory=set)
    handled: list[BoxHandling] = field(default_factory=list)
    violations: list[str] = field(default_factory=list)
    #: Vehicles in each lane in the order in which they came.
    order: dict[int, list[int]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for rank, node in enumerate(self.site.vehicles, start=1):
            self.bodies[node] = VehicleBody(node, self.site.machines[node].home.track, rank)
        for number, box in enumerate(self.site.boxes, start=1):
            self.standing.setdefault(box.station, []).append(number)

    def broken(self, time_us: int, what: str) -> None:
        """Note what must never happen."""
        self.violations.append(f"{time_us / 1e6:.3f} s: {what}")

    def leads(self, body: VehicleBody, entity: int, slot: int) -> bool:
        """Whether a body can go on into a slot from where it is at all: along the lane, or out of its end."""
        here = self.site.entities[body.entity]
        if here.kind is EntityKind.LANE and body.slot < here.capacity:
            return (entity, slot) == (body.entity, body.slot + 1)
        there = self.site.entities.get(entity)
        if there is None or entity not in here.leads_to:
            return False
        return there.kind is not EntityKind.LANE or slot == 1

    def enter(self, body: VehicleBody, entity: int, slot: int, time_us: int) -> None:
        """A body begins to move into a slot: from now on it is in both."""
        for other in self.bodies.values():
            if other is not body and (entity, slot) in ((other.entity, other.slot), other.target):
                place = self.site.entities[entity]
                if place.kind is EntityKind.AREA:
                    where = f"bay {slot} of {place.name}"
                else:
                    where = f"slot {slot} of {place.name}"
                self.broken(time_us, f"vehicles {other.node_id} and {body.node_id} are both in {where}")
        place = self.site.entities[entity]
        inside = [one for one in self.bodies.values() if entity in (one.entity, (one.target or (0, 0))[0])]
        if place.capacity and body not in inside and len(inside) >= place.capacity:
            self.broken(time_us, f"{len(inside) + 1} vehicles in {place.name}, which holds {place.capacity}")
        body.target = (entity, slot)
        if place.kind is EntityKind.LANE and entity != body.entity:
            self.order.setdefault(entity, []).append(body.node_id)

    def arrive(self, body: VehicleBody, time_us: int) -> None:
        """It is wholly in its new slot."""
        assert body.target is not None
        if body.target[0] != body.entity:
            row = self.order.get(body.entity, [])
            if row and row[0] != body.node_id and body.node_id in row:
                name = self.site.entities[body.entity].name
                self.broken(time_us, f"vehicle {body.node_id} overtook {row[0]} on {name}")
            if body.node_id in row:
                row.remove(body.node_id)
            body.came_from = body.entity
        body.entity, body.slot = body.target
        body.target = None

    def pick_up(self, body: VehicleBody, box: int, time_us: int) -> bool:
        """Take a box from the station in hand; False where it is not there, or not uppermost on a stack."""
        row = self.standing.get(body.entity, [])
        if body.box or box not in row:
            return False
        if self.site.entities[body.entity].station is StationKind.STACK and row[-1] != box:
            return False
        row.remove(box)
        body.box = box
        self.handled.append(BoxHandling(time_us, body.node_id, box, body.entity, is_up=True))
        return True

    def put_down(self, body: VehicleBody, time_us: int) -> bool:
        """Put the box down at the station in hand; False where there is no room."""
        row = self.standing.setdefault(body.entity, [])
        if not body.box or len(row) >= self.site.entities[body.entity].room:
            return False
        row.append(body.box)
        self.handled.append(BoxHandling(time_us, body.node_id, body.box, body.entity, is_up=False))
        body.box = 0
        return True

    def count_boxes(self, time_us: int) -> None:
        """Each box is in one place."""
        there = sorted(
            [box for row in self.standing.values() for box in row] + [b.box for b in self.bodies.values() if b.box]
        )
        if there != list(range(1, len(self.site.boxes) + 1)):
            self.broken(time_us, f"the boxes are {there}")
