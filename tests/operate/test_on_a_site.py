"""Commands to a running site in virtual time: what the machines do, and what the person is told."""

from functools import partial
from itertools import pairwise

from bus_sim.sites import find_site
from bus_sim.systems.car_park.simulation import Simulation
from onboard.contract.codes import MachineState, ManualMode, Reason
from onboard.contract.messages import Blocked, Clear, Heartbeat, ManualOrder, ManualState
from onboard.core.site import Segment
from onboard.operate.blocks import Mark
from onboard.operate.commands import Maker
from onboard.operate.holds import HoldCommand
from onboard.operate.status import Status
from tests.operate.played import Played, operates
from tests.system.scene import Scene, play, stays

SITE = find_site("small")
MR1 = SITE.machine("MR1")
STEWARD = SITE.stewards[1]


def played(
    *orders: tuple[float, Maker], without: frozenset[str] = frozenset(), limit_s: float = 200
) -> tuple[Scene, list[Played]]:
    """``limit_s``: short where a machine is off, as its devices say everything again and again to nobody."""
    told: list[Played] = []

    def before(simulation: Simulation) -> None:
        told.extend(operates(simulation, at_s, make) for at_s, make in orders)

    last_s = max(at_s for at_s, _ in orders) + 100
    extra_s = 5 if without else last_s - 60
    scene = play(SITE, stays((0, None)), before=before, limit_s=limit_s, extra_s=extra_s, without=without)
    return scene, told


def test_status_tells_who_lives_and_who_does_not_and_says_nothing() -> None:
    scene, (told,) = played(
        (27, lambda park, node: Status(park, node, 4_000_000)), without=frozenset({"MR2"}), limit_s=60
    )
    assert "MR1   works, at p(" in told.text
    assert "MR2   is not heard: off, or not on this bus" in told.text
    assert told.status == 1, "somebody is missing"
    assert not [one for one in scene.said if one.message.sender == 251]


def test_status_of_a_sound_site_ends_with_0() -> None:
    _, (told,) = played((30, lambda park, node: Status(park, node, 4_000_000)))
    assert told.status == 0 and len(told.lines) == len(SITE.machines)


def test_a_machine_is_held_and_released_by_its_own_word() -> None:
    hold = partial(HoldCommand, machine=MR1, holds=True, seed=5)
    release = partial(HoldCommand, machine=MR1, holds=False, seed=9)
    scene, (held, let_go) = played((21, hold), (90, release))
    assert held.status == 0 and held.lines[-1][1] == "MR1 is held, and stands"
    assert held.lines[-2][1] == "MR1 has answered: it begins nothing more, and comes to rest"
    assert let_go.lines[1][1] == "MR1 stands, others plan around it", "shown before the question"
    assert let_go.status == 0 and let_go.lines[-1][1] == "MR1 goes on by itself"
    states = {
        beat.state for t, beat in scene.all(Heartbeat) if beat.sender == MR1.node_id and held.ended_us < t < 90_000_000
    }
    assert states == {MachineState.OBSTACLE}
    last = [beat.state for _, beat in scene.all(Heartbeat) if beat.sender == MR1.node_id][-1]
    assert last is MachineState.IDLE and let_go.asked.startswith("Is nobody in the way of MR1")
    scene.assert_sound()


def test_who_is_let_go_by_another_before_it_has_come_to_rest_is_not_held_again() -> None:
    """The first station would have said its order again, every five seconds (drawn terminals, operators, 705)."""
    hold = partial(HoldCommand, machine=MR1, holds=True, seed=5)
    release = partial(HoldCommand, machine=MR1, holds=False, seed=9)
    scene, (held, let_go) = played((46, hold), (48.5, release))
    assert let_go.status == 0 and "MR1 goes on by itself" in let_go.text
    assert held.status == 1 and "MR1: another order came before it was over" in held.text
    assert scene.all(ManualState)[-1][1].manual_mode is ManualMode.AUTOMATIC
    scene.assert_sound()


def test_a_machine_that_is_off_does_not_confirm_and_is_named() -> None:
    scene, (told,) = played(
        (21, partial(HoldCommand, machine=MR1, holds=True, seed=5)), without=frozenset({"MR1"}), limit_s=40
    )
    assert told.status == 1
    assert told.lines[-2][1] == "MR1 does not answer; it is not heard: off, or not on this bus"
    assert told.lines[-1][1] == "not confirmed by MR1"
    said = [t for t, one in scene.all(ManualOrder) if one.sender == 251]
    assert len(said) == 10 and all(950_000 < b - a < 1_050_000 for a, b in pairwise(said))


def test_a_machine_in_the_same_mode_under_the_same_number_is_asked_under_another() -> None:
    """Another life of the station: the machine takes the order for the one it knows."""
    hold, release = (
        partial(HoldCommand, machine=MR1, holds=True, seed=5),
        partial(HoldCommand, machine=MR1, holds=False, seed=5),
    )
    scene, (held, let_go) = played((21, hold), (90, release))
    assert (held.status, let_go.status) == (0, 0)
    modes = [one.manual_mode for _, one in scene.all(ManualOrder)]
    assert modes[0] is ManualMode.HELD and modes[-1] is ManualMode.AUTOMATIC


def test_a_segment_is_blocked_and_cleared_by_the_word_of_its_steward() -> None:
    segment = Segment(1, 4)
    block = partial(Mark, segment=segment, reason=Reason.OPERATOR, blocks=True)
    clear = partial(Mark, segment=segment, reason=Reason.OPERATOR, blocks=False)
    scene, (blocked, cleared) = played((21, block), (60, clear))
    keeper = SITE.machines[STEWARD].name
    assert blocked.status == 0
    assert blocked.lines[-1][1] == f"{keeper} keeps it: {segment} is blocked, also after a power cut, until clear"
    assert cleared.status == 0 and cleared.lines[-1][1] == f"{keeper} keeps it: {segment} can be passed again"
    said = [type(one.message) for one in scene.said if isinstance(one.message, Blocked | Clear)]
    assert said[0] is Blocked and said[-1] is Clear
    journal = scene.simulation.journals[STEWARD].replay()
    assert [one["record"] for one in journal if one.get("record") in ("blocked", "clear")] == ["blocked", "clear"]


def test_to_clear_what_was_never_blocked_is_confirmed_too() -> None:
    _, (told,) = played((21, partial(Mark, segment=Segment(1, 4), reason=Reason.OPERATOR, blocks=False)))
    assert told.status == 0


def test_a_block_that_its_steward_does_not_keep_is_told() -> None:
    keeper = SITE.machines[STEWARD].name
    block = partial(Mark, segment=Segment(1, 4), reason=Reason.OPERATOR, blocks=True)
    _, (told,) = played((21, block), without=frozenset({keeper}), limit_s=40)
    assert told.status == 1 and told.lines[-1][1] == f"not confirmed by {keeper}"
