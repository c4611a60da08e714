"""Which faults a seed brings: a profile names the kinds, the seed draws machines, times and sizes."""

import random
from bisect import bisect_right
from collections.abc import Callable, Sequence
from math import log10
from typing import Final

from bus_sim.demand import DemandError
from bus_sim.faults.injection import Injection
from bus_sim.faults.table import TEN_YEARS_MS, Value
from bus_sim.systems.registry import simulated_of
from onboard.contract.codes import KindCode
from onboard.contract.constants import MOBILE_KINDS
from onboard.core.site import Site
from onboard.ways.site import TrackKind, way_site

#: Faults begin in this span after power-up, s, unless a system says otherwise: all end before it is over.
SPAN_S = (20.0, 900.0)
#: So many faults a run, unless a profile has a number of its own.
COUNT = (1, 4)
COUNTS: Final[dict[str, tuple[int, int]]] = {
    "two-crashes": (2, 2),
    "pushes": (6, 6),
    "operators": (3, 6),
    "devices": (3, 6),
}

#: At a rate, a fault that names a car names one of so many that came last, or the next: an older one has left.
CARS_AROUND = 5

Draw = Callable[[random.Random, Site], dict[str, Value]]


def _machine(chance: random.Random, site: Site) -> str:
    return chance.choice([machine.name for machine in site.machines.values()])


def _some(chance: random.Random, site: Site) -> str:
    names = [machine.name for machine in site.machines.values()]
    chosen = chance.sample(names, chance.randint(1, max(1, len(names) // 2)))
    return "|".join(sorted(chosen))


def _any(chance: random.Random, site: Site) -> str:
    """One machine to all of them."""
    names = [machine.name for machine in site.machines.values()]
    return "|".join(sorted(chance.sample(names, chance.randint(1, len(names)))))


def _jump_ms(chance: random.Random) -> int:
    """From a tenth of a second to ten years, as many small ones as large ones."""
    return chance.choice([-1, 1]) * round(10 ** chance.uniform(2, log10(TEN_YEARS_MS)))


def _of(kind: KindCode) -> Callable[[random.Random, Site], str]:
    def choose(chance: random.Random, site: Site) -> str:
        return chance.choice([machine.name for machine in site.machines.values() if machine.kind is kind])

    return choose


def _movables(site: Site) -> list[str]:
    """Machines that a person can hold."""
    return [machine.name for machine in site.machines.values() if machine.kind in MOBILE_KINDS and not site.no_hold]


def _movable(chance: random.Random, site: Site) -> str:
    return chance.choice(_movables(site))


_ROBOT, _COMPARTMENT = _of(KindCode.ROBOT), _of(KindCode.COMPARTMENT)


def _seed(chance: random.Random) -> int:
    return chance.randrange(1_000_000)


def _lasting(low_s: float, high_s: float, chance: random.Random) -> float:
    return round(chance.uniform(low_s, high_s), 3)


def _crash(chance: random.Random, site: Site) -> dict[str, Value]:
    drawn: dict[str, Value] = {"target": _machine(chance, site), "restart_s": _lasting(0.1, 20, chance)}
    how = chance.choice(["at once", "frame", "write", "durable"])
    if how == "frame":
        drawn["frame"] = chance.randint(1, 60)
    elif how != "at once":
        drawn |= {"write": chance.randint(1, 8), "durable": "yes" if how == "durable" else "no"}
    return drawn


_WAYS = ("both", "out", "in")

_BUS: Final[dict[str, Draw]] = {
    "burst": lambda c, _: {"for_s": _lasting(0.05, 2.0, c)},
    "bit_errors": lambda c, _: {"probability": c.choice([0.001, 0.01, 0.1]), "seed": _seed(c)},
    "lossy": lambda c, s: {"receivers": _some(c, s), "probability": c.choice([0.01, 0.05, 0.2]), "seed": _seed(c)},
    "reorder": lambda c, s: {"receivers": _some(c, s), "delay_ms": c.choice([2, 20, 200]), "seed": _seed(c)},
    "bus_off": lambda c, s: {"target": _machine(c, s), "for_s": _lasting(0.5, 5.0, c)},
    "partition": lambda c, s: {
        "members": _some(c, s),
        "for_s": _lasting(0.5, 15, c),
        "way": c.choice(_WAYS),
    },
    "overflow": lambda c, s: {"target": _machine(c, s), "queue": c.choice([1, 2, 8])},
    "babble": lambda c, _: {"for_s": _lasting(0.5, 8, c), "rate_hz": c.choice([500, 1500, 3000])},
}
_CRASH: Final[dict[str, Draw]] = {
    "crash": _crash,
    "pause": lambda c, s: {"target": _machine(c, s), "for_s": _lasting(0.2, 10, c)},
    "slow_node": lambda c, s: {"target": _machine(c, s), "processing_us": c.choice([500, 2000])},
    "power_cut": lambda c, _: {"for_s": _lasting(0.5, 20, c), "seed": _seed(c)},
}
_PEOPLE: Final[dict[str, Draw]] = {
    "lost_ticket": lambda c, _: {"car": c.randint(1, 6)},
    "key_presses": lambda c, s: {"target": _COMPARTMENT(c, s), "times": c.randint(1, 5)},
    "cancel": lambda c, _: {"car": c.randint(1, 6)},
    "linger": lambda c, _: {"car": c.randint(1, 6), "for_s": _lasting(60, 400, c)},
    "oversize": lambda c, _: {"car": c.randint(1, 6)},
    "moved": lambda c, s: {"target": _ROBOT(c, s), "by_mm": c.choice([-2400, -600, -40, 40, 600, 2400])},
}
#: From within a slot to beyond the next one, and so against whoever is near.
_PUSHES: Final[dict[str, Draw]] = {
    "moved": lambda c, s: {
        "target": _ROBOT(c, s),
        "by_mm": c.choice([-1, 1]) * c.choice([30, 100, 300, 600, 900, 1500, 2400, 4000]),
    },
}
#: Only in ``all``. A position sensor that lies plausibly, a broken bolt and a double node-ID are left to scenarios of
#: their own: what then follows is not the controllers' doing alone.
_MORE: Final[dict[str, Draw]] = {
    "disk_full": lambda c, s: {"target": _machine(c, s)},
    "drift": lambda c, s: {"target": _machine(c, s), "ppm": c.choice([-2000, -200, 200, 2000])},
    "clock_jump": lambda c, s: {"target": _machine(c, s), "by_ms": c.choice([-5000, -100, 100, 5000])},
    "sensor_off": lambda c, s: {"target": _machine(c, s)},
    "sensor_flaky": lambda c, s: {"target": _machine(c, s), "seed": _seed(c)},
    "actuator_stuck": lambda c, s: {"target": _machine(c, s)},
    "actuator_slow": lambda c, s: {"target": _ROBOT(c, s)},
    "actuator_halfway": lambda c, s: {"target": _ROBOT(c, s), "after_s": _lasting(0.1, 3, c)},
}

_CLOCKS: Final[dict[str, Draw]] = {
    "drift": lambda c, s: {
        "target": _any(c, s),
        "ppm": c.choice([-1, 1]) * round(10 ** c.uniform(2, 5)),
        "for_s": _lasting(20, 400, c),
    },
    "clock_frozen": lambda c, s: {"target": _any(c, s), "for_s": _lasting(0.5, 120, c)},
    "clock_jump": lambda c, s: {"target": _any(c, s), "by_ms": _jump_ms(c)},
}

#: Only where robots have batteries. A person charges one that has become empty once the fault is over.
_POWER: Final[dict[str, Draw]] = {
    "battery_drop": lambda c, s: {
        "target": _ROBOT(c, s),
        "percent": c.choice([0, 1, 2, 5, 20, 45]),
        "for_s": _lasting(60, 400, c),
    },
    "battery_drain": lambda c, s: {
        "target": _ROBOT(c, s),
        "factor": c.choice([3, 10, 30, 100]),
        "for_s": _lasting(60, 400, c),
    },
    "chargers_off": lambda c, _: {"for_s": _lasting(60, 400, c)},
}

#: What a cable, a supply or a fuse does until somebody comes: longer than any wait of the protocol's.
_OUTAGES: Final[dict[str, Draw]] = {
    "partition": lambda c, s: {"members": _some(c, s), "for_s": _lasting(30, 600, c), "way": c.choice(_WAYS)},
    "burst": lambda c, _: {"for_s": _lasting(5, 120, c)},
    "bus_off": lambda c, s: {"target": _machine(c, s), "for_s": _lasting(10, 120, c)},
    "babble": lambda c, _: {"for_s": _lasting(10, 90, c), "rate_hz": c.choice([500, 1500, 3000])},
    "crash": lambda c, s: {**_crash(c, s), "restart_s": _lasting(30, 900, c)},
    "pause": lambda c, s: {"target": _machine(c, s), "for_s": _lasting(10, 300, c)},
    "power_cut": lambda c, _: {"for_s": _lasting(20, 300, c), "seed": _seed(c)},
}


def _segment(chance: random.Random, site: Site) -> dict[str, Value]:
    """One that can be blocked."""
    ways = way_site(site)
    alleys = [number for number, track in ways.tracks.items() if track.kind is not TrackKind.LIFT]
    track = chance.choice(alleys)
    return {"track": track, "index": chance.randint(1, ways.tracks[track].length)}


#: Persons who stop machines, and let them go on; and machines that are off at such a time.
_OPERATORS: Final[dict[str, Draw]] = {
    "held": lambda c, s: {"target": _movable(c, s), "for_s": _lasting(5, 300, c)},
    "blocked": lambda c, s: {**_segment(c, s), "for_s": _lasting(5, 300, c)},
    "emergency_stop": lambda _, __: {},
    "operate": lambda c, _: {"do": "stop", "for_s": _lasting(1, 120, c)},
    "crash": _crash,
    "pause": _CRASH["pause"],
}

#: Worn and loose parts, and boards that are busy with something else, for as long as it takes until somebody comes.
_DEVICES: Final[dict[str, Draw]] = {
    "sensor_off": lambda c, s: {"target": _machine(c, s), "for_s": _lasting(0.5, 300, c)},
    "sensor_flaky": lambda c, s: {
        "target": _machine(c, s),
        "probability": round(c.uniform(0.05, 0.95), 2),
        "for_s": _lasting(30, 300, c),
        "seed": _seed(c),
    },
    "actuator_stuck": lambda c, s: {"target": _machine(c, s), "for_s": _lasting(0.5, 300, c)},
    "actuator_slow": lambda c, s: {
        "target": _movable(c, s),
        "factor": round(c.uniform(0.05, 0.9), 2),
        "for_s": _lasting(30, 300, c),
    },
    "actuator_halfway": lambda c, s: {
        "target": _movable(c, s),
        "after_s": _lasting(0.1, 10, c),
        "for_s": _lasting(0.5, 300, c),
    },
    "slow": lambda c, s: {
        "target": _any(c, s),
        "factor": round(10 ** c.uniform(0.3, 2), 1),
        "for_s": _lasting(30, 300, c),
    },
    "crash": _crash,
}

PROFILES: Final[dict[str, dict[str, Draw]]] = {
    "none": {},
    "bus": _BUS,
    "crash": _CRASH,
    "two-crashes": {"crash": _crash},
    "people": _PEOPLE,
    "pushes": _PUSHES,
    "all": {**_BUS, **_CRASH, **_PEOPLE, **_MORE, **_POWER},
    "clocks": _CLOCKS,
    "devices": _DEVICES,
    "operators": _OPERATORS,
    "outages": _OUTAGES,
    "power": {**_POWER, "crash": _crash, "pause": _CRASH["pause"], "power_cut": _CRASH["power_cut"]},
}
#: Kinds that have no moment of their own.
_WITHOUT_TIME = frozenset({"lost_ticket", "linger", "oversize"})


def profile_names(profiles: str) -> list[str]:
    """The profiles that a list with commas names. Raises ``DemandError`` for one that is none of ``PROFILES``."""
    for name in (names := profiles.split(",")):
        if name not in PROFILES:
            raise DemandError(f"--faults {name}: no such profile; profiles are {', '.join(PROFILES)}")
    return names


def kinds_for(profile: str, site: Site) -> dict[str, Draw]:
    """The kinds of a profile that are drawn for this site's system; of several those of all."""
    system = simulated_of(site)
    without = set() if _movables(site) else {"held"}
    kinds = {kind: draw for name in profile_names(profile) for kind, draw in PROFILES[name].items()}
    return {kind: draw for kind, draw in kinds.items() if system.draws(kind, site) and kind not in without}


def draw_faults(profile: str, seed: int, site: Site, span_s: tuple[float, float] = SPAN_S) -> tuple[Injection, ...]:
    """The faults of one seed, by time; always the same for the same profile, seed, site and span.

    Of several profiles each brings what it brings by itself.
    """
    if "," in profile:
        each = [fault for name in profile_names(profile) for fault in draw_faults(name, seed, site, span_s)]
        return tuple(sorted(each, key=lambda one: one.number("at_s") if "at_s" in one.given else 0.0))
    kinds = kinds_for(profile, site)
    if not kinds:
        return ()
    chance = random.Random(f"faults:{profile}:{site.name}:{seed}")
    drawn = []
    for _ in range(chance.randint(*COUNTS.get(profile, COUNT))):
        kind = chance.choice(list(kinds))
        at_s = round(chance.uniform(*span_s), 6)
        when: dict[str, Value] = {} if kind in _WITHOUT_TIME else {"at_s": at_s}
        drawn.append((at_s, Injection(kind, {**when, **kinds[kind](chance, site)})))
    return tuple(injection for _, injection in sorted(drawn, key=lambda one: one[0]))


def draw_at_rate(
    profile: str, seed: int, site: Site, an_hour: float, until_s: float, arrivals_s: Sequence[float] = ()
) -> tuple[Injection, ...]:
    """The faults of a long run: ``an_hour`` in the mean at random moments (a Poisson process) until ``until_s``.

    ``arrivals_s`` is when each car comes, in order, s after power-up. Always the same for the same arguments.
    """
    kinds = kinds_for(profile, site)
    if not kinds:
        return ()
    chance = random.Random(f"faults:{profile}:{site.name}:{seed}:{an_hour:g}")
    found, at_s = [], SPAN_S[0] + chance.expovariate(an_hour / 3600)
    while at_s < until_s:
        kind = chance.choice(list(kinds))
        when: dict[str, Value] = {} if kind in _WITHOUT_TIME else {"at_s": round(at_s, 6)}
        given = {**when, **kinds[kind](chance, site)}
        if "car" in given:
            number = bisect_right(arrivals_s, at_s) + 1 - chance.randrange(CARS_AROUND + 1)
            given["car"] = max(1, min(number, len(arrivals_s)))
        found.append(Injection(kind, given))
        at_s += chance.expovariate(an_hour / 3600)
    return tuple(found)
