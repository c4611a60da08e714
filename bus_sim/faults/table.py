"""The table of all kinds of faults but those of single frames: group, settings, what each does in one line."""

from collections.abc import Callable, Mapping
from enum import StrEnum
from typing import Final, NamedTuple

from bus_sim.attacks.catalogue import ATTACKS
from bus_sim.faults.journals import HARMS

Value = str | int | float


class Group(StrEnum):
    """Where a fault strikes; the table of a campaign counts by it."""

    BUS = "bus"
    CONTROLLER = "controller"
    CLOCK = "clock"
    SENSOR = "sensor"
    ACTUATOR = "actuator"
    PEOPLE = "people"
    POWER = "power"


class FaultSetting(NamedTuple):
    """How one setting is read, what it must be in words, its default (None: it must be given) and its range."""

    reader: Callable[[str], Value]
    wanted: str
    default: Value | None
    low: float = float("-inf")
    high: float = float("inf")


class Kind(NamedTuple):
    """One kind of fault: where it strikes, what it does in one line of help, and its settings by name."""

    group: Group
    summary: str
    settings: Mapping[str, FaultSetting]


def _whole(text: str) -> int:
    return int(text, 0)


def _seconds(default: float | None, low: float = 0.0) -> FaultSetting:
    return FaultSetting(float, f"seconds from {low:g} to 1000000", default, low, 1e6)


def _count(wanted: str, default: int | None, low: int = 0, high: int = 10**9) -> FaultSetting:
    return FaultSetting(_whole, wanted, default, low, high)


def _one_of(*words: str) -> FaultSetting:
    def read(text: str) -> str:
        return text if text in words else ""

    return FaultSetting(read, " or ".join(words), words[0])


#: The farthest that a clock jumps.
TEN_YEARS_MS: Final = 3_653 * 86_400_000
_MACHINE: Final = FaultSetting(str, "the name of a machine, such as MR1", None)
_MACHINES: Final = FaultSetting(str, "names of machines joined by |, such as MR1|ER1", None)
_SEED: Final = _count("a whole number", 0, low=-(2**63), high=2**63)
_CHANCE: Final = FaultSetting(float, "a number from 0 to 1", 0.3, 0.0, 1.0)
_AT: Final = _seconds(None)
_CAR: Final = _count("the number of a car in the order of arrival, from 1", None, low=1)


def _one(**more: FaultSetting) -> dict[str, FaultSetting]:
    """Settings of a fault that strikes one machine at a time."""
    return {"target": _MACHINE, "at_s": _AT, **more}


def _clocks(**more: FaultSetting) -> dict[str, FaultSetting]:
    """Settings of a fault that strikes the clocks of any machines."""
    return {"target": _MACHINES, "at_s": _AT, **more}


#: By name. ``at_s`` counts from power-up; what lasts has ``for_s``, and is over then.
KINDS: Final[Mapping[str, Kind]] = {
    "burst": Kind(
        Group.BUS,
        "every frame is destroyed and repeated",
        {"at_s": _AT, "for_s": _seconds(0.005), "seed": _SEED},
    ),
    "bit_errors": Kind(
        Group.BUS,
        "frames are destroyed by chance and repeated",
        {"at_s": _AT, "for_s": _seconds(60.0), "probability": _CHANCE._replace(default=0.01), "seed": _SEED},
    ),
    "reorder": Kind(
        Group.BUS,
        "some receivers hear frames late, after later ones",
        {
            "receivers": _MACHINES,
            "at_s": _AT,
            "for_s": _seconds(60.0),
            "delay_ms": _count("milliseconds from 1 to 10000", 20, 1, 10_000),
            "probability": _CHANCE,
            "seed": _SEED,
        },
    ),
    "lossy": Kind(
        Group.BUS,
        "some receivers miss frames, and nobody notices",
        {
            "receivers": _MACHINES,
            "at_s": _AT,
            "for_s": _seconds(60.0),
            "probability": _CHANCE._replace(default=0.05),
            "seed": _SEED,
        },
    ),
    "bus_off": Kind(
        Group.BUS,
        "a sender's frames fail until it is off the bus; what it had queued leaves later, stale",
        _one(for_s=_seconds(0.1), seed=_SEED),
    ),
    "partition": Kind(
        Group.BUS,
        "these machines and the others do not hear each other; with way=out nobody hears them, with way=in they nobody",
        {"members": _MACHINES, "at_s": _AT, "for_s": _seconds(5.0), "way": _one_of("both", "out", "in")},
    ),
    "overflow": Kind(
        Group.BUS,
        "a receive queue that is too short, behind a processor that is too slow",
        _one(
            for_s=_seconds(10.0),
            queue=_count("frames from 1 to 1000", 2, 1, 1_000),
            processing_us=_count("microseconds from 1 to 100000", 2_000, 1, 100_000),
        ),
    ),
    "babble": Kind(
        Group.BUS,
        "a foreign node sends one frame of high priority over and over",
        {
            "at_s": _AT,
            "for_s": _seconds(5.0),
            "rate_hz": _count("frames a second from 1 to 5000", 1_500, 1, 5_000),
            "id": _count("an identifier of 29 bits", 0x01FF00FE, 0, 0x1FFFFFFF),
        },
    ),
    "double_id": Kind(
        Group.BUS,
        "a second board with the same machine file joins the bus",
        _one(for_s=_seconds(5.0)),
    ),
    "attack": Kind(
        Group.BUS,
        "a node that sees only the bus attacks it, under a node-ID that the site does not have unless told",
        {
            "name": _one_of(*ATTACKS)._replace(default=None),
            "at_s": _AT,
            "for_s": _seconds(60.0),
            "node": _count("a node-ID", 240, 1, 255),
            "keys": _one_of("none", "stolen"),
            "seed": _SEED,
        },
    ),
    "crash": Kind(
        Group.CONTROLLER,
        "a controller loses power, at a time or (from then on) at its n-th frame or journal write, and starts again; "
        "person_s after it holds for its journal somebody has its rights made anew (0: nobody)",
        _one(
            restart_s=_seconds(5.0),
            restart=_one_of("yes", "no"),
            frame=_count("a whole number, 0 for none", 0),
            write=_count("a whole number, 0 for none", 0),
            durable=_one_of("no", "yes"),
            journal=_one_of(*HARMS),
            entries=_count("how many entries are cut off or rolled back, or which from the end is flipped", 10, 1),
            person_s=_seconds(0.0),
        ),
    ),
    "pause": Kind(
        Group.CONTROLLER,
        "a controller stands still, then goes on with what it believed",
        _one(for_s=_seconds(3.0)),
    ),
    "slow_node": Kind(
        Group.CONTROLLER,
        "a processor that needs long for each frame",
        _one(for_s=_seconds(60.0), processing_us=_count("microseconds from 1 to 100000", 2_000, low=1, high=100_000)),
    ),
    "slow": Kind(
        Group.CONTROLLER,
        "a processor so many times slower: searching takes time, from at_s on for for_s (0: to the end)",
        {
            "target": _MACHINES,
            "factor": FaultSetting(float, "a number from 0.1 to 1000", 8.0, 0.1, 1_000.0),
            "at_s": _seconds(0.0),
            "for_s": _seconds(0.0),
        },
    ),
    "disk_full": Kind(
        Group.CONTROLLER,
        "no journal entry can be written; the power is switched off and on when there is room again",
        _one(for_s=_seconds(30.0)),
    ),
    "power_cut": Kind(
        Group.CONTROLLER,
        "all controllers lose power and come back in an order drawn by chance",
        {"at_s": _AT, "for_s": _seconds(10.0), "spread_s": _seconds(5.0), "seed": _SEED},
    ),
    "drift": Kind(
        Group.CLOCK,
        "clocks that are too fast, or too slow, for for_s (0: until the controller is restarted)",
        _clocks(ppm=_count("millionths from -100000 to 100000", 200, -100_000, 100_000), for_s=_seconds(0.0)),
    ),
    "clock_frozen": Kind(
        Group.CLOCK,
        "clocks that stand still",
        _clocks(for_s=_seconds(10.0, low=0.001)),
    ),
    "clock_jump": Kind(
        Group.CLOCK,
        "clocks that jump, ten years at most",
        _clocks(
            by_ms=_count(f"milliseconds from -{TEN_YEARS_MS} to {TEN_YEARS_MS}", 2_000, -TEN_YEARS_MS, TEN_YEARS_MS)
        ),
    ),
    "sensor_off": Kind(Group.SENSOR, "a machine's sensors say nothing", _one(for_s=_seconds(30.0))),
    "sensor_stuck": Kind(Group.SENSOR, "a machine's sensors go on saying what they last said", _one(for_s=_seconds(5))),
    "sensor_flaky": Kind(
        Group.SENSOR,
        "some of what a machine's sensors say is lost",
        _one(for_s=_seconds(60.0), probability=_CHANCE, seed=_SEED),
    ),
    "sensor_wrong": Kind(
        Group.SENSOR,
        "a position sensor that is off by a little",
        _one(for_s=_seconds(30.0), by_mm=_count("millimetres from -10000 to 10000", 30, -10_000, 10_000)),
    ),
    "actuator_stuck": Kind(Group.ACTUATOR, "a machine's actuators hear no order", _one(for_s=_seconds(30.0))),
    "actuator_slow": Kind(
        Group.ACTUATOR,
        "a drive that moves slowly",
        _one(for_s=_seconds(120.0), factor=FaultSetting(float, "a number from 0.05 to 1", 0.3, 0.05, 1.0)),
    ),
    "actuator_halfway": Kind(
        Group.ACTUATOR,
        "a drive that takes up its next order and stops on the way",
        _one(for_s=_seconds(30.0), after_s=_seconds(1.5)),
    ),
    "battery_drop": Kind(
        Group.POWER,
        "cells of a robot's battery fail: its charge falls; who stands empty is charged by a person after for_s",
        _one(
            for_s=_seconds(300.0),
            percent=FaultSetting(float, "a number from 0 to 100", 2.0, 0.0, 100.0),
        ),
    ),
    "battery_drain": Kind(
        Group.POWER,
        "a robot's battery drains so many times faster; who stands empty is charged by a person after for_s",
        _one(for_s=_seconds(300.0), factor=FaultSetting(float, "a number from 1 to 1000", 10.0, 1.0, 1_000.0)),
    ),
    "chargers_off": Kind(Group.POWER, "no charger gives power", {"at_s": _AT, "for_s": _seconds(300.0)}),
    "lost_ticket": Kind(Group.PEOPLE, "a customer comes back without the ticket", {"car": _CAR}),
    "key_presses": Kind(
        Group.PEOPLE,
        "the key of a compartment is pressed again and again",
        _one(times=_count("a whole number from 1 to 100", 2, 1, 100), gap_s=_seconds(0.5)),
    ),
    "cancel": Kind(Group.PEOPLE, "a customer who is there, or comes back, presses cancel", {"car": _CAR, "at_s": _AT}),
    "linger": Kind(Group.PEOPLE, "a car does not leave for long", {"car": _CAR, "for_s": _seconds(180.0)}),
    "oversize": Kind(
        Group.PEOPLE,
        "a car of another length comes",
        {"car": _CAR, "length_mm": _count("millimetres from 1000 to 20000", 7_000, 1_000, 20_000)},
    ),
    "door_forced": Kind(
        Group.PEOPLE,
        "somebody breaks a door's bolt, as soon as both doors are locked and nobody is inside",
        _one(door=_one_of("input", "output")),
    ),
    "moved": Kind(
        Group.PEOPLE,
        "a standing carrier with its shuttle home is pushed along its track, as far as the next body lets it",
        _one(by_mm=_count("millimetres from -10000 to 10000", 600, -10_000, 10_000)),
    ),
    "blocked": Kind(
        Group.PEOPLE,
        "an operator says that nobody can pass a segment; after for_s, that it can be passed again (0: never)",
        {
            "track": _count("the number of a track, from 1", None, 1, 254),
            "index": _count("the index of a segment, from 1", None, 1, 255),
            "at_s": _AT,
            "for_s": _seconds(120.0),
        },
    ),
    "emergency_stop": Kind(Group.PEOPLE, "an operator holds all machines at once, for half a minute", {"at_s": _AT}),
    "held": Kind(
        Group.PEOPLE,
        "a person holds a machine that moves about; after for_s, lets it go on (0: never)",
        _one(for_s=_seconds(120.0)),
    ),
    "operate": Kind(
        Group.PEOPLE,
        "a person gives a command of onboard operate and agrees; target: whom hold, release, go or regenerate name",
        {
            "at_s": _AT,
            "do": _one_of("stop", "go", "block", "clear", "hold", "release", "regenerate")._replace(default=None),
            "target": _MACHINE._replace(default=""),
            "track": _count("the number of a track, for block, clear and an absent body", 1, 1, 254),
            "index": _count("the index of a segment, for block, clear and an absent body", 1, 1, 255),
            "absent": _one_of("no", "yes"),
            "body": FaultSetting(str, "a slot such as p(1;5), or gone, for regenerate", ""),
            "for_s": _seconds(10.0),
        },
    ),
}
