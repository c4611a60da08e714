"""The exact optimum of a small case by OR-Tools CP-SAT (extra ``optimum``): who does what, in which order, and where.

It knows all customers beforehand and may send robots before they are called, so no rule can do better.
"""

from dataclasses import dataclass, field
from importlib.util import find_spec
from typing import Any

from bus_sim.systems.car_park.compare.small_case import Case, earliest_finish, play_case

#: Bound of one search in CP-SAT's deterministic time (about seconds): a wall-time bound would not replay.
MAX_EFFORT = 60.0


class OptimumError(RuntimeError):
    """No optimum: the solver is not installed, or its bound was reached before the proof."""


def is_available() -> bool:
    """Whether OR-Tools, which proves the optimum, is installed."""
    return find_spec("ortools") is not None


@dataclass
class _Car:
    """Variables of one car, ms: its place; for each task when a robot has to be where, and when it is done."""

    place: Any
    to_bay: Any
    reach_park: Any
    parked: Any
    reach_fetch: Any = None
    fetched_from: Any = None
    fetched: Any = None


@dataclass
class _TaskAsSeen:
    """One task as robots see it: of which car, and whether it fetches."""

    car: int
    fetches: bool


@dataclass
class _Model:
    case: Case
    cp: Any
    horizon: int
    cars: list[_Car] = field(default_factory=list)
    waits: list[Any] = field(default_factory=list)
    bays: list[Any] = field(default_factory=list)
    tasks: list[_TaskAsSeen] = field(default_factory=list)

    def time(self, name: str) -> Any:
        return self.cp.new_int_var(0, self.horizon, name)

    def way(self, index: Any, table: list[int], name: str) -> Any:
        found = self.cp.new_int_var(min(table), max(table), name)
        self.cp.add_element(index, table, found)
        return found


def least_waiting_ms(case: Case) -> int:
    """The least total waiting of all customers (ms). Raises ``OptimumError`` where it cannot be had."""
    if not is_available():
        raise OptimumError("OR-Tools is not installed; install the extra: pip install 'onboard-fleet[optimum]'")
    from ortools.sat.python import cp_model  # noqa: PLC0415  # optional, and slow to import

    known_ms = play_case(case, earliest_finish)
    last_ms = max(one.departure_ms or one.arrival_ms for one in case.visitors)
    # A plan as good as a known one keeps nobody waiting longer than that one all together; then robots finish.
    finishing_ms = max(map(max, case.way_ms)) + case.handle_ms + case.open_ms + case.close_ms
    model = _Model(case, cp_model.CpModel(), last_ms + known_ms + 2 * len(case.visitors) * finishing_ms)
    for number in range(len(case.visitors)):
        _add_car(model, number)
    model.cp.add_no_overlap(model.bays)
    _share_places(model)
    _route_robots(model)
    model.cp.add(sum(model.waits) <= known_ms)
    model.cp.minimize(sum(model.waits))
    solver = cp_model.CpSolver()
    solver.parameters.num_workers = 1
    solver.parameters.random_seed = 1
    solver.parameters.max_deterministic_time = MAX_EFFORT
    status = solver.solve(model.cp)
    if status != cp_model.OPTIMAL:
        raise OptimumError(f"no optimum proven within the solver's bound: {solver.status_name(status)}")
    return round(solver.objective_value)


def _add_car(model: _Model, number: int) -> None:
    case, cp, visitor = model.case, model.cp, model.case.visitors[number]
    places = len(case.places)
    place = cp.new_int_var(0, places - 1, f"place {number}")
    to_bay = model.way(place, [case.way_ms[at][case.bay] for at in range(places)], f"way {number}")
    begin, taken = model.time(f"enters {number}"), model.time(f"taken {number}")
    reach, parked = model.time(f"at bay for {number}"), model.time(f"parked {number}")
    out = begin + case.react_ms + visitor.drive_in_ms + visitor.walk_ms
    cp.add(begin >= visitor.arrival_ms)
    cp.add(taken >= reach + case.open_ms + case.handle_ms)
    cp.add(taken >= out + case.close_ms + case.open_ms + case.handle_ms)
    cp.add(parked == taken + to_bay + case.handle_ms)
    _occupy(model, begin, taken + case.close_ms + case.open_ms, f"bay for {number}")
    model.waits.append(out - visitor.arrival_ms)
    model.tasks.append(_TaskAsSeen(number, fetches=False))
    car = _Car(place, to_bay, reach, parked)
    model.cars.append(car)
    if visitor.departure_ms is not None:
        _add_fetching(model, number, car, out)


def _add_fetching(model: _Model, number: int, car: _Car, parked_out: Any) -> None:
    case, cp, visitor = model.case, model.cp, model.case.visitors[number]
    asked, begin = model.time(f"asked {number}"), model.time(f"bay closes for {number}")
    car.reach_fetch, car.fetched_from = model.time(f"at car {number}"), model.time(f"fetched {number}")
    car.fetched = model.time(f"brought {number}")
    cp.add_max_equality(asked, [visitor.departure_ms, parked_out])
    cp.add(begin >= asked)
    cp.add(begin >= car.parked)
    for least in (car.reach_fetch, begin + case.close_ms):
        cp.add(car.fetched_from >= least + case.handle_ms)
    cp.add(car.fetched == car.fetched_from + car.to_bay + case.open_ms + case.handle_ms)
    gone = car.fetched + case.close_ms + case.open_ms + case.react_ms + visitor.drive_out_ms
    _occupy(model, begin, gone, f"bay from {number}")
    model.waits.append(gone - asked)
    model.tasks.append(_TaskAsSeen(number, fetches=True))


def _occupy(model: _Model, begin: Any, end: Any, name: str) -> None:
    length = model.time(f"{name}, length")
    model.bays.append(model.cp.new_interval_var(begin, length, end, name))


def _share_places(model: _Model) -> None:
    """Two cars stand in different places, or one after the other."""
    cp, handle_ms = model.cp, model.case.handle_ms
    for number, one in enumerate(model.cars):
        for other in model.cars[:number]:
            apart = cp.new_bool_var("")
            cp.add(one.place != other.place).only_enforce_if(apart)
            ways = [apart]
            for first, second in ((one, other), (other, one)):
                if first.fetched_from is not None:
                    after = cp.new_bool_var("")
                    cp.add(second.parked - handle_ms >= first.fetched_from).only_enforce_if(after)
                    ways.append(after)
            cp.add_bool_or(ways)


def _route_robots(model: _Model) -> None:
    """Each task is on exactly one robot's way, and the robot goes from task to task."""
    cp = model.cp
    done: list[list[Any]] = [[] for _ in model.tasks]
    ways: dict[tuple[int, int], Any] = {}
    for robot, home in enumerate(model.case.homes):
        arcs = [(0, 0, cp.new_bool_var(f"robot {robot} rests"))]
        for number, task in enumerate(model.tasks, start=1):
            skipped = cp.new_bool_var("")
            done[number - 1].append(skipped.negated())
            arcs.append((number, number, skipped))
            arcs.append((number, 0, cp.new_bool_var("")))
            first = cp.new_bool_var("")
            arcs.append((0, number, first))
            cp.add(_reach(model, task) >= _from_home(model, home, task)).only_enforce_if(first)
            for other, before in enumerate(model.tasks, start=1):
                if other != number:
                    follows = cp.new_bool_var("")
                    arcs.append((other, number, follows))
                    if (other, number) not in ways:
                        ways[other, number] = _between(model, before, task)
                    cp.add(_reach(model, task) >= _end(model, before) + ways[other, number]).only_enforce_if(follows)
        cp.add_circuit(arcs)
    for robots in done:
        cp.add_exactly_one(robots)


def _reach(model: _Model, task: _TaskAsSeen) -> Any:
    car = model.cars[task.car]
    return car.reach_fetch if task.fetches else car.reach_park


def _end(model: _Model, task: _TaskAsSeen) -> Any:
    car = model.cars[task.car]
    return car.fetched if task.fetches else car.parked


def _from_home(model: _Model, home: int, task: _TaskAsSeen) -> Any:
    row = list(model.case.way_ms[home])
    if not task.fetches:
        return row[model.case.bay]
    return model.way(model.cars[task.car].place, row[: len(model.case.places)], "")


def _between(model: _Model, before: _TaskAsSeen, task: _TaskAsSeen) -> Any:
    """The empty way from where one task ends to where another begins."""
    here, there = model.cars[before.car], model.cars[task.car]
    if not task.fetches:
        return 0 if before.fetches else here.to_bay
    if before.fetches:
        return there.to_bay
    if before.car == task.car:
        return 0
    count = len(model.case.places)
    table = [model.case.way_ms[row][column] for row in range(count) for column in range(count)]
    return model.way(here.place * count + there.place, table, "")
