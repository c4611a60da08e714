"""Rules of authority: tokens, motion, bodies, lifts."""

from dataclasses import replace

import pytest

from onboard.config.site import parse_site
from onboard.contract.codes import DriveMode, KindCode, MachineState, Reason, TokenKind
from onboard.contract.messages import (
    BusTime,
    DriveOrder,
    DriveState,
    Halted,
    Heartbeat,
    Message,
    PlatformState,
    TokenHeld,
)
from onboard.core.site import Segment
from onboard.ways.site import way_site
from tests.sites import one_floor
from tests.trace.checking import (
    ER1,
    GATE,
    LIFT,
    MR1,
    MR2,
    PLATFORM,
    TWO_FLOORS,
    Tape,
    at,
    grant,
    one_alley,
    power_up,
    two_floors,
)

SLOT = Segment(1, 10)


def held(node: int, version: int) -> TokenHeld:
    return TokenHeld(node, TokenKind.SEGMENT, SLOT.number, version)


# --- one holder ------------------------------------------------------------------------------------------------

GOOD_HANDOVERS: dict[str, list[Message]] = {
    "there and back": [grant(SLOT, 1, 1, MR1), held(MR1, 1), grant(SLOT, 2, MR1, 1), grant(SLOT, 3, 1, MR2)],
    "said again": [grant(SLOT, 1, 1, MR1), grant(SLOT, 1, 1, MR1), grant(SLOT, 2, MR1, 1), grant(SLOT, 1, 1, MR1)],
    "overtaken by the next grant": [grant(SLOT, 1, 1, MR1), grant(SLOT, 2, MR1, 1), held(MR1, 1)],
}


@pytest.mark.parametrize("messages", GOOD_HANDOVERS.values(), ids=GOOD_HANDOVERS.keys())
def test_a_right_may_move_by_its_holder_and_be_said_again(messages: list[Message]) -> None:
    assert Tape(one_alley()).say(1, *messages).broken() == {}


BAD_HANDOVERS: dict[str, list[Message]] = {
    "given by one that never had it": [grant(SLOT, 1, MR2, MR1)],
    "given to two": [grant(SLOT, 1, 1, MR1), grant(SLOT, 1, 1, MR2)],
    "taken back": [grant(SLOT, 1, 1, MR1), grant(SLOT, 2, 1, MR2)],
    "a version left out": [grant(SLOT, 1, 1, MR1), grant(SLOT, 3, MR1, 1)],
    "held by another": [grant(SLOT, 1, 1, MR1), held(MR2, 1)],
    "held without a grant": [grant(SLOT, 1, 1, MR1), held(MR2, 2)],
    "given to itself": [grant(SLOT, 1, 1, 1)],
}


@pytest.mark.parametrize("messages", BAD_HANDOVERS.values(), ids=BAD_HANDOVERS.keys())
def test_two_holders_are_found(messages: list[Message]) -> None:
    assert Tape(one_alley()).say(1, *messages).broken() == {"one-holder": 1}


def test_segments_in_line_go_under_a_version_newer_than_each() -> None:
    neighbour = SLOT._replace(index=SLOT.index - 1)
    said = [grant(neighbour, 1, 1, MR1), grant(neighbour, 2, MR1, 1), grant(SLOT, 3, 1, MR1)]
    assert Tape(one_alley()).say(1, *said).broken() == {}
    assert Tape(one_alley()).say(1, *said, grant(SLOT, 5, MR1, 1)).broken() == {"one-holder": 1}


def test_a_right_that_was_given_on_is_not_claimed_later() -> None:
    tape = Tape(one_alley()).say(1, grant(SLOT, 1, 1, MR1), grant(SLOT, 2, MR1, 1))
    assert tape.say(3, held(MR1, 1)).broken() == {"one-holder": 1}


def life(node: int, state: MachineState, boot: int = 2) -> Heartbeat:
    return Heartbeat(node, 1, 1, 0, boot, KindCode.ROBOT, state)


def test_an_old_journal_that_is_told_at_a_start_is_no_second_holder() -> None:
    """It is for the others to compare; who then holds tells it again to all who ask."""
    tape = Tape(None).say(1, grant(SLOT, 1, 1, MR1), grant(SLOT, 2, MR1, 1))
    tape.say(3, life(MR1, MachineState.STARTING), held(MR1, 1))
    tape.say(4, life(MR1, MachineState.OBSTACLE), Halted(MR1, MR1, Reason.JOURNAL_SHORT, 1, True, 2), held(MR1, 1))
    assert tape.broken() == {}


@pytest.mark.parametrize(
    "then",
    [
        [life(MR1, MachineState.IDLE), held(MR1, 1)],
        [grant(SLOT, 2, MR1, MR2)],
        [grant(SLOT, 3, MR1, MR2)],
        [held(MR1, 2)],
    ],
    ids=["keeps it and acts", "gives it again", "gives what it has not", "another's version"],
)
def test_who_uses_an_old_journal_is_found(then: list[Message]) -> None:
    tape = Tape(one_alley()).say(1, grant(SLOT, 1, 1, MR1), grant(SLOT, 2, MR1, 1))
    tape.say(3, life(MR1, MachineState.STARTING), held(MR1, 1))
    assert tape.say(5, *then).broken() == {"one-holder": 1}


@pytest.mark.parametrize(
    ("said", "runs"),
    [
        # The word of five seconds waited for three: the only other machine was off, and nobody acknowledged it.
        ([BusTime(1, 5_000_000)], 1),
        ([BusTime(1, 0)], 2),
        ([power_up(), BusTime(1, 3_000_000)], 2),
        # A bus was dead for a while: two told the time meanwhile, and then all that they had said comes at once.
        ([BusTime(1, 5_000_000), BusTime(2, 1_500_000), BusTime(1, 6_000_000), BusTime(2, 2_000_000)], 1),
    ],
    ids=["held up", "stands still", "begins anew", "held up, of two"],
)
def test_a_word_of_the_time_that_was_held_up_begins_no_other_run(said: list[Message], runs: int) -> None:
    tape = Tape(one_alley()).say(1, grant(SLOT, 1, 1, MR1), BusTime(1, 1_000_000))
    assert tape.say(8, *said).say(8.1, grant(SLOT, 2, MR1, 1)).verdict().runs == runs


def test_a_log_that_begins_in_the_middle_takes_the_first_word_for_granted() -> None:
    tape = Tape(one_alley(), started=False).say(1, grant(SLOT, 7, MR2, MR1), grant(SLOT, 8, MR1, 1))
    assert tape.broken() == {}


def test_versions_wrap_and_leave_0_out() -> None:
    tape = Tape(one_alley(), started=False).say(1, grant(SLOT, 65535, 1, MR1), grant(SLOT, 1, MR1, 1))
    assert tape.broken() == {}


# --- motion ------------------------------------------------------------------------------------------------


def test_a_body_moves_in_what_it_holds_with_its_braking_distance() -> None:
    tape = Tape(one_alley()).say(1, at(MR1, 1, 12)).say(2, grant(Segment(1, 11), 1, MR2, MR1))
    tape.say(3, at(MR1, 1, 12, -600, -500), at(MR1, 1, 11))
    assert tape.broken() == {}


@pytest.mark.parametrize(
    "where",
    [at(MR1, 1, 11, 0, -10), at(MR1, 1, 12, -600, -10), at(MR1, 1, 12, 0, -1000)],
    ids=["in another's slot", "half in it", "too fast to stop before it"],
)
def test_a_body_outside_its_authority_is_found_once(where: Message) -> None:
    tape = Tape(one_alley()).say(1, at(MR1, 1, 12)).say(2, where, where)
    assert tape.broken() == {"inside-authority": 1}


def beat(node: int, boot: int = 1) -> Heartbeat:
    return Heartbeat(node, 1, 1, 0, boot, KindCode.ROBOT, MachineState.IDLE)


def test_who_is_pushed_by_hand_has_time_to_ask_and_no_more() -> None:
    pushed = Tape(one_alley()).say(1, at(MR1, 1, 12)).say(2, at(MR1, 1, 11))
    assert pushed.say(2.01, grant(Segment(1, 11), 1, MR2, MR1)).say(90, beat(MR1)).broken() == {}
    stays = Tape(one_alley()).say(1, at(MR1, 1, 12)).say(2, at(MR1, 1, 11))
    assert stays.say(60, beat(MR1)).say(63, beat(MR1)).broken() == {"inside-authority": 1}
    drives = Tape(one_alley()).say(1, at(MR1, 1, 12)).say(2, at(MR1, 1, 11)).say(3, at(MR1, 1, 11, 0, -10))
    assert drives.broken() == {"inside-authority": 1}


def test_who_is_pushed_out_of_a_mouth_before_it_has_told_its_turn_was_pushed_all_the_same() -> None:
    """Its controller was off meanwhile; the last that it had said was of the spur's axis (drawn car parks, 4234)."""
    spur = one_floor(2, extra='[[spurs]]\nat = "p(1,7)"\n')
    tape = Tape(spur).say(1, grant(Segment(1, 7), 1, 1, MR1), grant(Segment(192, 1), 1, 1, MR1))
    tape.say(2, at(MR1, 192, 0)).say(3, at(MR1, 1, 5))
    assert tape.broken() == {}
    assert tape.say(60, beat(MR1)).say(64, beat(MR1)).broken() == {"inside-authority": 1}
    entered = Tape(spur).say(1, grant(Segment(1, 7), 1, 1, MR1)).say(2, at(MR1, 1, 7)).say(3, at(MR1, 192, 1))
    assert entered.say(60, beat(MR1)).broken() == {}


@pytest.mark.parametrize(("boot", "broken"), [(2, {}), (1, {"inside-authority": 1})])
def test_who_drove_as_it_failed_and_is_elsewhere_when_it_starts_again_was_pushed(
    boot: int, broken: dict[str, int]
) -> None:
    """In the same life it has driven there (drawn car parks, 4245)."""
    tape = Tape(one_alley()).say(1, beat(MR1), at(MR1, 1, 12, 0, -10)).say(20, beat(MR1, boot), at(MR1, 1, 9))
    assert tape.broken() == broken
    assert tape.say(70, beat(MR1, boot)).say(85, beat(MR1, boot)).broken() == {"inside-authority": 1}


def test_a_slot_given_back_too_early_is_found() -> None:
    tape = Tape(one_alley()).say(1, grant(Segment(1, 11), 1, MR2, MR1), grant(Segment(1, 12), 1, MR1, 1))
    assert tape.say(1.05, at(MR1, 1, 12, -600)).broken() == {}, "frames may overtake each other"
    tape = Tape(one_alley()).say(1, grant(Segment(1, 11), 1, MR2, MR1), grant(Segment(1, 12), 1, MR1, 1))
    assert tape.say(2, at(MR1, 1, 12, -600)).broken() == {"inside-authority": 1}


def test_a_drive_is_sent_no_farther_than_the_machine_may_go() -> None:
    tape = Tape(one_alley()).say(1, at(MR1, 1, 12), DriveState(MR1, 0, 26400, 0, DriveMode.STANDING, at_mark=True))
    tape.say(2, DriveOrder(MR1, 1, 26400, 1500))
    assert tape.say(3, DriveOrder(MR1, 2, 24000, 1500)).broken() == {"inside-authority": 1}


def test_an_order_that_crosses_the_push_by_hand_is_excused_and_none_after_it() -> None:
    stood = DriveState(MR1, 0, 26400, 0, DriveMode.STANDING, at_mark=True)
    tape = Tape(one_alley()).say(1, at(MR1, 1, 12), stood).say(2, replace(stood, position_mm=25800, at_mark=False))
    tape.say(2.02, DriveOrder(MR1, 1, 26400, 1500))
    assert tape.broken() == {}, "it waited for the journal when the drive was pushed (campaign standard, seed 50041)"
    assert tape.say(2.2, DriveOrder(MR1, 2, 26400, 1500)).broken() == {"inside-authority": 1}


@pytest.mark.parametrize(
    ("other_at", "target_mm", "broken"),
    [
        pytest.param(11, 26_400, {}, id="away from who has the right and stands there"),
        pytest.param(11, 24_000, {"inside-authority": 1}, id="towards it"),
        pytest.param(8, 26_400, {"inside-authority": 1}, id="who has the right is elsewhere, and can give it"),
    ],
)
def test_who_is_pushed_against_another_may_drive_away_from_it(
    other_at: int, target_mm: int, broken: dict[str, int]
) -> None:
    stood = DriveState(MR1, 0, 26_400, 0, DriveMode.STANDING, at_mark=True)
    tape = Tape(one_alley()).say(1, at(MR1, 1, 12), stood)
    if other_at != 11:
        tape.say(1.2, grant(Segment(1, other_at), 1, 1, MR2))
    tape.say(1.5, at(MR2, 1, other_at))
    tape.say(2, at(MR1, 1, 12, -100), replace(stood, position_mm=26_300, at_mark=False))
    assert tape.say(3, DriveOrder(MR1, 1, target_mm, 1_500)).broken() == broken


def test_it_may_do_so_before_its_word_that_it_was_pushed_is_on_the_bus() -> None:
    """Started again, it says much else first (drawn lines, 863)."""
    stood = DriveState(MR1, 0, 26_400, 0, DriveMode.STANDING, at_mark=True)
    tape = Tape(one_alley()).say(1, at(MR1, 1, 12), stood).say(1.5, at(MR2, 1, 11))
    tape.say(2, replace(stood, position_mm=26_300, at_mark=False)).say(3, DriveOrder(MR1, 1, 26_400, 1_500))
    assert tape.broken() == {}
    assert tape.say(3.1, DriveOrder(MR1, 2, 24_000, 1_500)).broken() == {"inside-authority": 1}


def test_where_nobody_knows_the_holder_nothing_is_judged_but_counted() -> None:
    verdict = Tape(one_alley(), started=False).say(1, at(MR1, 1, 5)).verdict()
    assert verdict.is_good and verdict.unjudged


def test_two_bodies_closer_than_a_carrier_are_found() -> None:
    tape = Tape(one_alley()).say(1, at(MR1, 1, 12), at(MR2, 1, 11))
    assert tape.broken() == {}
    tape = Tape(one_alley(), started=False).say(1, at(MR1, 1, 12, -600), at(MR2, 1, 11))
    assert tape.broken() == {"one-body": 1}


@pytest.mark.parametrize(("speed_mm_s", "broken"), [(1_500, {}), (-1_500, {"one-body": 1}), (0, {"one-body": 1})])
def test_who_drove_away_when_its_power_failed_is_farther_by_now(speed_mm_s: int, broken: dict[str, int]) -> None:
    gone = at(MR1, 1, 12, -600, speed_mm_s)
    assert Tape(one_alley(), started=False).say(1, gone, at(MR2, 1, 11)).broken() == broken


def test_who_is_pushed_to_where_another_was_may_find_that_it_has_set_off() -> None:
    """It drove, and had not said so yet (drawn car parks, 4785); who stands there says nothing more."""

    def pushed() -> Tape:
        stood = Tape(one_alley(), started=False).say(1, at(MR1, 1, 12), at(MR2, 1, 11))
        return stood.say(2, at(MR1, 1, 12, -300))

    assert pushed().say(3, at(MR2, 1, 10, 600, -1_500)).say(24, beat(MR1)).say(26, beat(MR1)).broken() == {}
    assert pushed().say(3, beat(MR1)).say(24, beat(MR1)).say(26, beat(MR1)).broken() == {"one-body": 1}
    assert pushed().say(3, at(MR2, 1, 11)).broken() == {"one-body": 1}


def test_two_bodies_on_one_platform_are_found_whatever_their_floors() -> None:
    tape = Tape(two_floors(), started=False).say(1, at(ER1, LIFT, 1), at(MR1, 1, 0), at(MR2, 2, 0))
    assert tape.broken() == {"one-body": 1}


# --- lifts ------------------------------------------------------------------------------------------------


def test_a_lift_moves_with_its_gate() -> None:
    tape = Tape(two_floors()).say(1, at(ER1, LIFT, 1), at(ER1, LIFT, 1, 300, 500), at(ER1, LIFT, 2))
    assert tape.broken() == {}


def test_a_lift_that_moves_while_a_robot_has_its_gate_is_found() -> None:
    tape = Tape(two_floors()).say(1, at(ER1, LIFT, 1), grant(GATE, 1, ER1, MR2))
    assert tape.say(2, at(ER1, LIFT, 1, 300, 500)).broken() == {"lift-by-gate": 1}


def test_a_lift_that_is_sent_while_a_robot_has_its_gate_is_found() -> None:
    tape = Tape(two_floors()).say(1, at(ER1, LIFT, 1), grant(GATE, 1, ER1, MR2))
    assert tape.say(2, DriveOrder(ER1, 1, 2500, 1000)).broken() == {"lift-by-gate": 1}


def test_a_lift_crushing_what_overhangs_its_sill_is_found_by_its_curtain() -> None:
    curtain = PlatformState(ER1, carrier_aboard=False, crossing=True, load_kg=0)
    tape = Tape(two_floors()).say(1, at(ER1, LIFT, 1), curtain)
    assert tape.say(2, DriveOrder(ER1, 1, 2500, 1000)).broken() == {"lift-crush": 1}
    free = PlatformState(ER1, carrier_aboard=True, crossing=False, load_kg=0)
    tape = Tape(two_floors()).say(1, at(ER1, LIFT, 1), curtain, free)
    assert tape.say(2, DriveOrder(ER1, 1, 2500, 1000)).broken() == {}


def test_a_lift_crushing_what_overhangs_its_sill_is_found_from_the_fleet_bus_alone() -> None:
    rights = [grant(slot, 1, node, MR2) for slot, node in ((Segment(1, 1), 1), (PLATFORM, ER1), (GATE, ER1))]
    tape = Tape(two_floors()).say(1, at(ER1, LIFT, 1), *rights).say(2, at(MR2, 1, 0, 600))
    assert tape.say(3, at(ER1, LIFT, 1, 300, 500)).broken() == {"lift-by-gate": 1, "lift-crush": 1}


def test_a_robot_over_the_sill_of_an_empty_shaft_is_found() -> None:
    rights = [grant(slot, 1, node, MR2) for slot, node in ((Segment(1, 1), 1), (PLATFORM, ER1), (GATE, ER1))]
    tape = Tape(two_floors()).say(1, at(ER1, LIFT, 1), *rights).say(2, at(MR2, 1, 0, 600))
    assert tape.broken() == {}
    tape = Tape(two_floors()).say(1, at(ER1, LIFT, 2), *rights).say(2, at(MR2, 1, 0, 600))
    assert tape.broken() == {"platform-there": 1}


@pytest.mark.parametrize(("sensed_mm", "broken"), [(0, {}), (-1250, {"platform-there": 1})])
def test_an_order_repeated_to_a_robot_that_came_off_the_sill_is_none_over_it(
    sensed_mm: int, broken: dict[str, int]
) -> None:
    """Between two borders of segments only the drive tells that the sill is free; the lift may go at once."""
    rights = [grant(Segment(1, index), 1, 1, MR2) for index in (1, 2)]
    tape = Tape(two_floors()).say(1, at(ER1, LIFT, 1), *rights).say(2, at(MR2, 1, 1, -1250, 1095))
    state = DriveState(MR2, 1, sensed_mm, 1500, DriveMode.MOVING, at_mark=False)
    tape.say(3, state, at(ER1, LIFT, 1, 300, 500)).say(4, DriveOrder(MR2, 1, 2500, 1500))
    assert {rule: count for rule, count in tape.broken().items() if rule == "platform-there"} == broken


#: Two floors of three alleys in line, and lifts between them that one drives through.
IN_LINE = """
[site]
name = "in-line"
[floors]
count = 2
positions = 6
[[alleys]]
name = "B"
positions = 6
[[alleys]]
name = "C"
positions = 6
[[lifts]]
name = "L1"
node = 5
doors = ["p(*,6)", "p(*,B,1)"]
[[lifts]]
name = "L2"
node = 6
doors = ["p(*,B,6)", "p(*,C,1)"]
[[compartments]]
name = "In"
node = 1
at = "p(1,3)"
[[robots]]
name = "MR1"
node = 11
home = "p(2,3)"
"""


@pytest.mark.parametrize(("stop", "broken"), [(1, {}), (3, {"platform-there": 1})])
def test_an_order_through_one_lift_to_another_is_judged_by_the_floor_of_that(stop: int, broken: dict[str, int]) -> None:
    """It leads from an alley to which the second lift has no door."""
    site = way_site(parse_site(IN_LINE, "in-line.toml"))
    tape = Tape(site).say(1, at(5, LIFT, 1), at(6, LIFT + 1, stop), at(MR1, 1, 7))
    tape.say(2, DriveOrder(MR1, 1, site.tracks[3].origin_mm + 6 * 2_400, 1500))
    assert {rule: count for rule, count in tape.broken().items() if rule == "platform-there"} == broken


def test_where_platforms_lie_at_different_positions_of_a_straight_buildings_alleys_the_tape_tells_the_alley() -> None:
    """At a right shaft, of alleys of different lengths: a drive's position of one is not taken for one of the other."""
    text = TWO_FLOORS.replace('end = "left"', 'end = "right"').replace(
        "[floors]", "[floors.2]\npositions = 8\n[floors]"
    )
    site = way_site(parse_site(text, "right.toml", crowded=True))
    below, above = (site.tracks[floor].origin_mm + length * 2_400 for floor, length in ((1, 10), (2, 8)))
    assert [site.on_tape(place) for place in (below, above)] == [(1, 24_000), (2, 19_200)]
    # And where they lie at one position of all, it is one tape for all, as drives of such buildings have always had it.
    assert not any(track.origin_mm for track in way_site(two_floors()).tracks.values())
