"""A compacted journal means what the whole one meant: for every machine of every system, at whatever length."""

import random
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache

import pytest

from bus_sim.campaign.trial import STEP_US, stage_of
from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.run import run_until
from bus_sim.sites import find_site
from bus_sim.systems.car_park.demand import Arrivals
from bus_sim.systems.registry import simulated_of
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.core.journal_records import JournalRecord, by_name
from onboard.core.records import CORE_RECORDS
from onboard.core.site import Site
from onboard.holon.holon import Holon
from onboard.io.sealed import SLOTS_BYTES, read
from onboard.ports.journal import Entry
from onboard.systems.registry import compaction_for, factory_for, system_of
from onboard.work.compaction import NUMBERS_KEPT, compact
from tests.conformance.cases import CASES
from tests.conformance.runs import site_file, site_of
from tests.thinned import is_long, some

GO_ON = [name for name, case in CASES.items() if case.goes_on]
#: Lengths at which each journal is cut.
CUTS = 12 if is_long() else 4


def played(name: str) -> tuple[Site, dict[int, list[Entry]]]:
    """A site's journals after a run in which machines lose power, by node-ID."""
    site = site_of(name)
    if name != "car-park":
        victims = [machine.name for machine in site.machines.values()][:3]
        faults = [
            parse_injection(f"crash:target={one},at_s={40 + 9 * at},restart_s=2") for at, one in enumerate(victims)
        ]
        scenario = FaultScenario(site_file(name), 1, simulated_of(site).patience_s(site, None, 1), faults=tuple(faults))
    else:
        faults = [parse_injection(f"crash:target={one},at_s={at},restart_s=2") for one, at in CRASHES]
        scenario = FaultScenario("small", 3, 3_600, Arrivals(4, 60.0, 20.0, 90.0), faults=tuple(faults))
    loop = VirtualTimeLoop()

    async def play() -> dict[int, list[Entry]]:
        stage = stage_of(site, scenario, loop)
        arm(stage.run, scenario.faults)
        stage.run.start()
        await run_until(stage.run, lambda: stage.is_over, round(scenario.limit_s * 1e6), STEP_US)
        assert stage.is_over
        return {node: journal.entries for node, journal in stage.run.journals.items()}

    return site, run_on(loop, play())


CRASHES = (("MR1", 75.0), ("IOC1", 150.0), ("ER1", 200.0))
journals = cache(played)


def state(site: Site, node: int, entries: list[Entry]) -> object:
    """Everything that a controller believes when it starts with these entries."""
    machine = site.machines[node]
    holon = Holon(site, machine, factory_for(site, machine.kind), boot=9, entries=entries)
    holon.fleet.entries = ()
    holon.tokens.changes = holon.tokens.beliefs.changes = 0
    return Plain().of([holon.tokens, holon.mirror, holon.behaviour, holon.presence])


#: Tables that are looked up by key and never gone through: their order says when a key was first heard of.
BY_KEY_ONLY = ("seen", "given", "verified", "tasks")
#: What is a value by itself: a tuple, as a union of classes would be made anew each time that it is asked about.
PLAIN = (str, int, float, Enum, bytes, type(None))


class Plain:
    """A value without identities: objects by their attributes, in their order, and what many have made out once."""

    def __init__(self) -> None:
        self._inside = set[int]()
        #: Each value is kept with what it came to, as another could have its identity later.
        self._known: dict[tuple[int, bool], tuple[object, object]] = {}

    def of(self, value: object, name: str = "") -> object:
        """What the attribute ``name`` comes to."""
        if isinstance(value, PLAIN):
            return value
        if id(value) in self._inside or isinstance(value, Site) or callable(value):
            return type(value).__name__
        key = (id(value), name in BY_KEY_ONLY)
        if key not in self._known:
            self._inside.add(id(value))
            self._known[key] = value, self._made(value, key[1])
            self._inside.remove(id(value))
        return self._known[key][1]

    def _made(self, value: object, is_unordered: bool) -> object:
        if isinstance(value, Mapping):
            items = sorted(value.items()) if is_unordered else value.items()
            return [(self.of(key), self.of(one)) for key, one in items]
        if isinstance(value, set | frozenset):
            return sorted(repr(self.of(one)) for one in value)
        if isinstance(value, list | tuple | deque):
            return [self.of(one) for one in value]
        names = (
            [one.name for one in fields(value)]
            if is_dataclass(value) and not hasattr(value, "__dict__")
            else vars(value)
        )
        return type(value).__name__, [(name, self.of(getattr(value, name), name)) for name in names]


def differing(one: object, other: object, where: str) -> Iterator[str]:
    """Where two states differ, and in what."""
    if isinstance(one, list | tuple) and isinstance(other, list | tuple) and len(one) == len(other):
        for index, (here, there) in enumerate(zip(one, other, strict=True)):
            name = here[0] if isinstance(here, tuple) and isinstance(here[0], str) else index
            yield from differing(here, there, f"{where}/{name}")
    elif one != other:
        yield f"{where}: {one} != {other}"[:300]


@pytest.mark.parametrize("name", GO_ON)
def test_a_compacted_journal_means_the_same(name: str) -> None:
    site, every = journals(name)
    fewer, chance = compaction_for(site), random.Random(name)
    for node, entries in every.items():
        compacted = fewer(entries)
        lengths = [len(entries), *(chance.randrange(len(entries)) for _ in range(CUTS))]
        for length in lengths:
            whole = entries[:length]
            kept = fewer(whole)
            now, before = state(site, node, kept), state(site, node, whole)
            assert now == before, (site.machines[node].name, length, list(differing(now, before, "")))
            assert fewer(kept) == kept
            # Written anew in between, too.
            assert fewer([*kept, *entries[length:]]) == compacted


def kept(records: list[Entry], name: str) -> list[Entry]:
    return compact(system_of(site_of(name)).records, records)


@pytest.mark.parametrize("name", GO_ON)
def test_every_type_of_record_has_a_rule(name: str) -> None:
    """One without would be kept for good, and the journal grow for ever."""
    types = (*CORE_RECORDS, *system_of(site_of(name)).records)
    homes = {one.__module__ for one in types}
    made = {one for one in classes(JournalRecord) if one.NAME and one.__module__ in homes}
    assert {one.__name__ for one in made} == {one.__name__ for one in types}
    assert [one.__name__ for one in types if not one.RULES] == []
    _, every = journals(name)
    used = Counter(str(entry["record"]) for entries in every.values() for entry in entries)
    assert used.keys() <= by_name(*types).keys()


def classes(record: type[JournalRecord]) -> Iterator[type[JournalRecord]]:
    """All that are made of one."""
    yield record
    for one in record.__subclasses__():
        yield from classes(one)


def test_what_nobody_knows_is_kept() -> None:
    strange: list[Entry] = [{"record": "of tomorrow", "n": 1}, {"record": "of tomorrow", "n": 1}]
    assert kept(strange, "car-park") == strange


def test_the_last_give_of_a_token_is_kept_beside_what_came_after() -> None:
    def token(record: str, version: int) -> Entry:
        return {"record": record, "kind": 0, "number": 266, "version": version, "holder": 11}

    records = [token(f"token_{what}", version) for version in range(1, 9) for what in ("held", "given", "gone")]
    assert kept(records, "car-park") == [token("token_given", 8), token("token_gone", 8)]
    assert kept([*records, token("token_held", 9)], "car-park") == [
        token("token_given", 8),
        token("token_gone", 8),
        token("token_held", 9),
    ]


def test_a_car_that_left_is_forgotten_with_all_that_was_about_it() -> None:
    about: list[Entry] = [
        {"record": "car_at", "car_origin": 1, "car": 5, "station": 260, "version": 3, "wheelbase_mm": 2500},
        {"record": "token_held", "kind": 2, "number": 65541, "version": 3, "holder": 1},
        {"record": "winner", "car_origin": 1, "car": 5, "winner": 11, "task_origin": 1, "task": 5, "version": 1},
        {"record": "token_given", "kind": 2, "number": 65541, "version": 4, "holder": 11},
        {"record": "token_gone", "kind": 2, "number": 65541, "version": 4, "holder": 11},
    ]
    left: Entry = {"record": "retired", "kind": 2, "number": 65541, "load_origin": 1, "load": 5}
    assert kept([*about, left], "car-park") == []
    assert len(kept(about, "car-park")) == len(about) - 1


def test_cars_whose_leaving_was_not_heard_are_forgotten_by_their_numbers() -> None:
    def car(number: int) -> list[Entry]:
        token = {"kind": 2, "number": 65536 + number, "holder": 11}
        return [{"record": "token_held", "version": 1, **token}, {"record": "token_gone", "version": 2, **token}]

    many = [entry for number in range(1, 3_000) for entry in car(number)]
    assert len(kept(many, "car-park")) == NUMBERS_KEPT + 1
    held = car(1)[:1]
    assert kept([*held, *many[2:]], "car-park")[:1] == held, "a right that is held is never forgotten"


@pytest.mark.parametrize("at_s", some([30.0, 100.0, 160.0], 2))
def test_a_machine_at_rest_writes_its_journal_anew_and_goes_on(at_s: float) -> None:
    """Each journal is made shorter again and again while cars come and go and machines lose power."""
    site = find_site("small")
    faults = tuple(
        parse_injection(f"crash:target={one.name},at_s={at_s},restart_s=2") for one in site.machines.values()
    )
    scenario = FaultScenario("small", 3, 3_600, Arrivals(4, 60.0, 20.0, 90.0), faults=faults)
    loop = VirtualTimeLoop()
    identities: dict[int, set[str]] = {node: set() for node in site.machines}

    async def play() -> list[str]:
        stage = stage_of(site, scenario, loop)
        arm(stage.run, faults)
        stage.run.start()
        for journal in stage.run.journals.values():
            journal.least_bytes = SLOTS_BYTES

        def look() -> None:
            for node, journal in stage.run.journals.items():
                assert journal.medium is not None
                found = read(bytes(journal.medium), journal.owner, "x")
                assert found.tail is not None
                identities[node].add(found.tail.identity)

        await run_until(stage.run, lambda: stage.is_over, 3_600_000_000, STEP_US, look)
        assert stage.is_over
        return stage.violations()

    assert run_on(loop, play()) == []
    # The first is made at power-up.
    assert all(max(found) > f"{1:016x}" for found in identities.values()), identities
    assert sum(len(found) for found in identities.values()) > len(identities) + 2
