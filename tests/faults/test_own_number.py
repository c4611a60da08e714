"""Somebody sends under a machine's number: it holds and says so, and comes back; what needs a person, needs one."""

from functools import partial

import pytest

from bus_sim.faults.arm import arm
from bus_sim.faults.injection import Injection
from bus_sim.run import FLEET
from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import CallResult, Reason, TokenKind
from onboard.contract.messages import Award, Diagnostic, Go, Halted, Heartbeat, Message, Reference, TokenGrant
from onboard.core.frame import Frame
from onboard.wire.codec import fleet_codec
from tests.system.scene import Scene, play, stays

ROBOT, OPERATOR = 11, 251
CODEC = fleet_codec()


def says(simulation: Simulation, at_s: float, message: Message, name: str = "tool") -> None:
    """A tool on the bus says something at a time."""
    node = simulation.fleet.attach(f"{name} {at_s} {message}", None)
    for frame in CODEC.encode(message):
        simulation.plant.timers.call_at(round(at_s * 1e6), partial(node.send, frame))


def words(scene: Scene, node: int = ROBOT) -> list[tuple[int, Halted]]:
    """What was said of a machine that does not act."""
    return [(time_us, word) for time_us, word in scene.all(Halted, FLEET) if word.machine == node]


def test_a_frame_under_its_number_holds_a_robot_for_some_seconds_only() -> None:
    forged = Diagnostic(ROBOT, Reason.LATE, 1)
    scene = play(find_site("small"), stays((0, 200)), before=lambda run: says(run, 15, forged))
    scene.assert_sound()
    told = words(scene)
    assert [(w.reason, w.cause, w.needs_person) for _, w in told] == [(Reason.DUPLICATE_NODE_ID, ROBOT, False)] * len(
        told
    )
    assert 3 <= len(told) <= 5
    boots = {beat.boot for time_us, beat in scene.all(Heartbeat, FLEET) if beat.sender == ROBOT and time_us > 25e6}
    assert boots == {2}, "it comes back as after a restart"
    assert scene.simulation.plant.street.summary().served == 1


def test_a_second_board_holds_the_machine_while_it_is_there() -> None:
    def plug(run: Simulation) -> None:
        arm(run, [Injection("double_id", {"target": "MR1", "at_s": 12.0, "for_s": 20.0})])

    scene = play(find_site("small"), stays((0, 200)), plant=plug)
    assert max(time_us for time_us, _ in words(scene)) > 30e6
    assert scene.simulation.controllers[ROBOT].holon.halted is None
    assert scene.simulation.plant.street.summary().served == 1


@pytest.mark.parametrize("go", [True, False])
def test_an_award_under_its_number_needs_a_person(go: bool) -> None:
    task = Reference(ROBOT, 1)
    forged = Award(ROBOT, 3, 12, task, 1, CallResult.AWARDED, Reason.NONE)

    def act(run: Simulation) -> None:
        says(run, 15, forged)
        if go:
            says(run, 60, Go(OPERATOR, ROBOT))

    scene = play(find_site("small"), stays(), before=act, extra_s=120)
    last_us, last = words(scene)[-1]
    assert (last.reason, last.needs_person) == (Reason.DUPLICATE_NODE_ID, True)
    assert (last_us < 61e6) is go
    boots = [beat.boot for _, beat in scene.all(Heartbeat, FLEET) if beat.sender == ROBOT]
    assert boots[-1] == (2 if go else 1)


def test_a_right_that_was_taken_from_it_meanwhile_is_found_when_it_comes_back() -> None:
    """A person who lets it go on does not make two holders: all say what they hold, and that is compared."""
    forged = TokenGrant(ROBOT, TokenKind.SEGMENT, find_site("small").machines[ROBOT].home.number, 7, 12)

    def act(run: Simulation) -> None:
        says(run, 15, forged)
        says(run, 60, Go(OPERATOR, ROBOT))

    scene = play(find_site("small"), stays(), before=act, extra_s=120)
    _, last = words(scene)[-1]
    assert (last.reason, last.needs_person) == (Reason.JOURNAL_SHORT, True)


def test_a_log_that_is_played_on_the_live_bus_does_not_stop_the_fleet_for_good() -> None:
    """Frames of half a minute, from power-up on and with a car in hand, are played 100 s later as they were."""
    site = find_site("small")

    def record(run: Simulation) -> None:
        player = run.fleet.attach("canplayer", None)

        def keep(frame: Frame, time_us: int, _: str) -> None:
            if 5e6 <= time_us < 35e6:
                run.plant.timers.call_at(time_us + 100_000_000, partial(player.send, frame))

        run.fleet.tap(keep)
        for node in site.machines:
            says(run, 150, Go(OPERATOR, node))

    scene = play(site, stays((0, 300), (160, 400)), before=record)
    held = {word.machine for time_us, word in scene.all(Halted, FLEET) if time_us > 105e6}
    assert held == set(site.machines), "everybody was spoken for"
    late = {word.machine for time_us, word in scene.all(Halted, FLEET) if time_us > 160e6}
    assert late == set()
    assert scene.simulation.plant.oracle.finish() == []
    assert scene.simulation.plant.street.summary().served == 2
