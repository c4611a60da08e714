"""A machine whose journal is short or somebody else's stays on the bus, holds, says why, and comes back as it says."""

import pytest

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import parse_injection
from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import MachineState, Reason, RegenerationPhase
from onboard.contract.messages import (
    BusTime,
    Diagnostic,
    DriveOrder,
    Halted,
    Heartbeat,
    Message,
    Regeneration,
    RegenerationState,
    ShuttleOrder,
    SyncDone,
    SyncRequest,
    TokenSeen,
)
from onboard.core.journal_state import JournalState
from tests.sites import at_the_key
from tests.system.scene import Scene, play, stays
from tests.thinned import some

SITE = at_the_key(find_site("small"))
CARS = stays((0, 320), (60, 380), (120, 440), (300, None))
MR2 = SITE.machine("MR2").node_id


def played(*faults: str, tool: bool = False, limit_s: float = 1_500) -> Scene:
    """``tool``: some tool says FREEZE at 90 s, whatever is so."""

    def plant(simulation: Simulation) -> None:
        arm(simulation, [parse_injection(fault) for fault in faults])

    def before(simulation: Simulation) -> None:
        bus = simulation.fleet.attach("tool", 251)
        for frame in simulation.codecs.fleet.encode(Regeneration(251, RegenerationPhase.FREEZE, 1, MR2, 0, 0, 0)):
            simulation.loop.call_at(90.0, bus.send, frame)

    return play(SITE, CARS, plant=plant, before=before if tool else None, limit_s=limit_s)


def said_by(scene: Scene, node: int, from_s: float, bus: str = "fleet") -> list[Message]:
    return [
        one.message
        for one in scene.said
        if one.bus == bus and one.message.sender == node and one.time_us > from_s * 1e6
    ]


def assert_safe(scene: Scene) -> None:
    """Nothing is broken; that its task waits until others take it from a machine that holds is no fault of theirs."""
    assert scene.simulation.plant.oracle.finish() == []
    assert scene.verdict().counts.keys() <= {"something-happens"}
    assert not [one for one in scene.simulation.controllers.values() if one.holon.halted]


def served(scene: Scene) -> int:
    return scene.simulation.plant.street.summary().served


def told(scene: Scene) -> list[str]:
    return [line for _, who, line in scene.simulation.log.lines if who == "operator"]


#: A machine whose journal gets short, when, and where it stands then.
SHORT = (("MR1", 50, ",body=p(1;5)"), ("MR2", 20, ",body=p(3;8)"), ("IOC1", 190, ""), ("ER1", 50, ""))


@pytest.mark.parametrize(
    ("name", "at_s", "body", "again"), some([(*one, again) for one in SHORT for again in (False, True)], 4)
)
def test_a_short_journal_is_brought_back_by_the_operator(name: str, at_s: int, body: str, again: bool) -> None:
    came_s, node = at_s + 30, SITE.machine(name).node_id
    faults = [f"crash:target={name},at_s={at_s},restart_s=5,journal=unsealed"]
    faults += [f"crash:target={name},at_s={at_s + 12},restart_s=5"] if again else []
    scene = played(*faults, f"operate:do=regenerate,at_s={came_s},target={name}{body}")
    scene.assert_sound()
    held = [one for one in said_by(scene, node, at_s + 5) if isinstance(one, Halted)]
    assert {(one.machine, one.reason, one.needs_person) for one in held} == {(node, Reason.JOURNAL_SHORT, True)}
    assert len(held) > (came_s - at_s - 12) * 1e6 / SITE.timing.heartbeat_us
    assert (scene.simulation.plant.street.summary().parked, served(scene)) == (4, 3)
    assert f"{name} is in epoch 1" in told(scene)
    assert scene.simulation.journals[node].condition.state is JournalState.INTACT


def test_while_its_journal_is_short_a_machine_moves_nothing_and_takes_no_part() -> None:
    scene = played("crash:target=MR2,at_s=20,restart_s=5,journal=unsealed")
    assert_safe(scene)
    said = said_by(scene, MR2, 30)
    assert {one.state for one in said if isinstance(one, Heartbeat)} == {MachineState.OBSTACLE}
    assert {type(one).__name__ for one in said} <= {"Heartbeat", "Halted", "SyncRequest", "SyncDone", "Diagnostic"}
    orders = [one for one in said_by(scene, MR2, 30, "MR2") if isinstance(one, DriveOrder | ShuttleOrder)]
    assert not orders
    assert served(scene) == 3, "the other robot goes on beside it"


def test_somebody_elses_journal_is_never_written_and_its_machine_says_what_to_do() -> None:
    scene = played(
        "crash:target=MR2,at_s=20,restart_s=5,journal=foreign",
        "operate:do=regenerate,at_s=40,target=MR2,body=p(3;8)",
        tool=True,
    )
    assert_safe(scene)
    said = said_by(scene, MR2, 20)
    assert {type(one) for one in said} <= {Heartbeat, Halted, BusTime, Diagnostic, RegenerationState}
    held = [one for one in said if isinstance(one, Halted)]
    assert {(one.reason, one.needs_person) for one in held} == {(Reason.JOURNAL_FOREIGN, True)}
    assert len(held) > 100
    answer = [one for one in said if isinstance(one, RegenerationState)]
    assert [(one.regeneration_phase, one.reason) for one in answer] == [
        (RegenerationPhase.REFUSED, Reason.JOURNAL_FOREIGN)
    ]
    assert not [one for one in said_by(scene, MR2, 26, "MR2") if isinstance(one, DriveOrder | ShuttleOrder)]
    medium = scene.simulation.journals[MR2].medium
    assert medium is not None and b"another machine" in medium
    assert any(line.startswith("MR2: its journal is another machine's") for line in told(scene))
    assert served(scene) == 3, "the other robot goes on beside it"


def test_a_foreign_journal_that_is_taken_out_is_a_lost_one() -> None:
    """The remedy that its machine tells: that file away, start it, regenerate."""
    scene = played(
        "crash:target=MR2,at_s=20,restart_s=5,journal=foreign",
        "crash:target=MR2,at_s=40,restart_s=5,journal=lost",
        "operate:do=regenerate,at_s=60,target=MR2,body=p(3;8)",
    )
    scene.assert_sound()
    assert served(scene) == 3 and "MR2 is in epoch 1" in told(scene)


def test_who_was_told_that_its_journal_is_old_vouches_for_nothing_any_more() -> None:
    """Point 9,159 of `small --exhaustive journal --scene overlap`: it put a car back into its bay that had left."""
    scene = played("crash:target=IOC1,at_s=190,restart_s=5,journal=rolled_back,entries=10", limit_s=300)
    assert_safe(scene)
    node = SITE.machine("IOC1").node_id
    at_us, word = scene.first(Halted, lambda one: one.sender == node)
    assert word.reason is Reason.JOURNAL_SHORT and word.needs_person
    said = {type(one) for one in said_by(scene, node, at_us / 1e6)}
    assert SyncDone in said, "who asks is answered, and has not to wait"
    assert said <= {Heartbeat, Halted, BusTime, SyncRequest, SyncDone, TokenSeen, Diagnostic}


@pytest.mark.parametrize(
    ("name", "at_s", "body", "entries", "again"),
    [("IOC1", 190, "", 10, False), ("IOC1", 190, "", 40, True), ("MR1", 50, ",body=p(1;5)", 8, True)],
)
def test_an_old_journal_is_forgotten_before_its_rights_are_made_anew(
    name: str, at_s: int, body: str, entries: int, again: bool
) -> None:
    """What it said of tasks and cars was gone on with, and nobody was served any more."""
    faults = [f"crash:target={name},at_s={at_s},restart_s=5,journal=rolled_back,entries={entries}"]
    faults += [f"crash:target={name},at_s={at_s + 15},restart_s=5"] if again else []
    scene = played(*faults, f"operate:do=regenerate,at_s={at_s + 30},target={name}{body}")
    assert_safe(scene)
    assert scene.first(Halted, lambda one: one.sender == one.machine)[1].reason is Reason.JOURNAL_SHORT
    assert served(scene) == 3 and f"{name} is in epoch 1" in told(scene)


def test_a_journal_that_never_gave_a_task_that_a_robot_has_is_old() -> None:
    """Point 1,131 of `level1 --exhaustive journal`: no token was newer elsewhere, and its customer waited for ever."""

    def plant(simulation: Simulation) -> None:
        crash = "crash:target=IOC1,at_s=0,restart_s=5,write=40,journal=rolled_back,entries=10"
        arm(simulation, [parse_injection(crash)])

    scene = play(find_site("level1"), stays((0, 120)), plant=plant, limit_s=240)
    assert_safe(scene)
    at_us, word = scene.first(Halted, lambda one: one.sender == one.machine)
    assert (word.reason, word.needs_person) == (Reason.JOURNAL_SHORT, True) and at_us > 140_000_000
    assert any("has task 2 of this node, which it never gave" in line for _, _, line in scene.simulation.log.lines)
