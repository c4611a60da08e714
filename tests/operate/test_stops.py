"""stop, go and release of machines that hold: who answered, who did not, and who undoes it."""

import pytest

from onboard.contract.codes import MachineState, Reason
from onboard.contract.messages import EmergencyStop, Go, ManualOrder
from onboard.operate.commands import CommandRequest, maker_of
from onboard.operate.names import OperateError
from tests.operate.hand import ALL, SITE, Hand, beat, halted

STOPPED = Reason.EMERGENCY_STOP
MR1 = SITE.machine("MR1").node_id


def test_stop_is_said_each_second_until_all_hold_and_then_on() -> None:
    hand = Hand(maker_of(SITE, CommandRequest("stop"), 1)).begin()
    hand.turn(3, *(halted(node, STOPPED, 251) for node in ALL[:-1]))
    assert not hand.is_over() and hand.lines.count("MR1 holds by it") == 1
    hand.turn(7, *(halted(node, STOPPED, 251) for node in ALL))
    assert "all hold" in hand.lines
    assert hand.all(EmergencyStop) == [EmergencyStop(251, Reason.OPERATOR)] * 10
    assert hand.order.interrupt(hand.now_us) == [] and hand.order.status == 0
    assert "30 s more" in hand.order.news()[-1]


def test_stop_for_0_s_ends_once_all_hold() -> None:
    hand = Hand(maker_of(SITE, CommandRequest("stop", for_us=0), 1)).begin()
    hand.turn(5, *(halted(node, STOPPED, 251) for node in ALL))
    assert hand.order.status == 0 and len(hand.said) < 5


def test_who_does_not_say_that_it_holds_is_named_and_the_status_is_1() -> None:
    hand = Hand(maker_of(SITE, CommandRequest("stop", for_us=0), 1)).begin()
    hand.turn(
        12, beat(MR1, MachineState.WORKING), *(halted(node, STOPPED, 251) for node in ALL if node not in (MR1, 12))
    )
    assert hand.order.status == 1
    assert "MR1 has NOT said that it holds; it works" in hand.lines
    assert "MR2 has NOT said that it holds; it is not heard: off, or not on this bus" in hand.lines
    assert "not confirmed by MR1, MR2" in hand.lines


def test_a_machine_that_holds_for_another_reason_has_not_confirmed() -> None:
    hand = Hand(maker_of(SITE, CommandRequest("stop", for_us=0), 1)).begin()
    others = [halted(node, STOPPED, 251) for node in ALL if node != MR1]
    hand.turn(12, halted(MR1, Reason.DUPLICATE_NODE_ID, MR1), *others)
    assert hand.order.status == 1


def test_another_tool_lifts_the_stop() -> None:
    hand = Hand(maker_of(SITE, CommandRequest("stop"), 1)).begin()
    hand.turn(2, *(halted(node, STOPPED, 251) for node in ALL))
    hand.hear(Go(252, 253))
    assert not hand.is_over(), "it lifts somebody else's"
    hand.hear(Go(252, 251))
    assert hand.order.status == 0 and "node 252 has lifted this stop" in hand.order.news()


def test_go_shows_who_stands_and_why_and_is_said_until_they_go_on() -> None:
    standing = [halted(node, STOPPED, 253) for node in ALL]
    hand = Hand(maker_of(SITE, CommandRequest("go"), 1), standing)
    shown = hand.order.preview(hand.now_us)
    assert "MR1 stands: emergency stop by node 253; goes on by itself" in shown
    assert "shall the emergency stop be lifted?" in hand.order.question
    hand.begin()
    hand.turn(2, *standing)
    assert not hand.is_over()
    hand.turn(5, *(beat(node) for node in ALL))
    assert hand.order.status == 0 and "MR1 goes on" in hand.lines
    assert set(hand.said) == {Go(251, 0)}


def test_go_of_one_stopper_is_not_waited_for_by_who_stands_for_another() -> None:
    before = [halted(MR1, STOPPED, 240), halted(12, STOPPED, 253)]
    hand = Hand(maker_of(SITE, CommandRequest("go", of="240"), 1), before).begin()
    hand.turn(6, beat(MR1), beat(12), halted(12, STOPPED, 253))
    assert hand.order.status == 0 and set(hand.said) == {Go(251, 240)}


def test_go_against_a_stop_that_is_still_said_names_who_says_it() -> None:
    hand = Hand(maker_of(SITE, CommandRequest("go"), 1), [halted(MR1, STOPPED, 252)]).begin()
    hand.turn(1)
    hand.hear(EmergencyStop(252, Reason.OPERATOR))
    assert not hand.is_over(), "it had not heard the Go yet"
    hand.turn(1)
    hand.hear(EmergencyStop(252, Reason.OPERATOR))
    assert hand.order.status == 1 and "node 252 still says stop: end it there first" in hand.order.news()


def test_who_does_not_go_on_is_named_with_its_reason() -> None:
    hand = Hand(maker_of(SITE, CommandRequest("go"), 1), [halted(MR1, STOPPED, 253)]).begin()
    hand.turn(12, beat(MR1), halted(MR1, STOPPED, 253))
    assert hand.order.status == 1 and "not confirmed by MR1" in hand.lines


def test_a_machine_that_holds_for_a_person_is_released_by_go_under_its_number() -> None:
    twin = halted(MR1, Reason.DUPLICATE_NODE_ID, MR1, needs_person=True)
    hand = Hand(maker_of(SITE, CommandRequest("release", machine="MR1"), 1), [twin])
    assert "needs a person" in hand.order.preview(hand.now_us)[0]
    hand.begin()
    hand.turn(2, twin)
    assert not hand.is_over()
    hand.turn(5, beat(MR1, boot=2))
    assert hand.order.status == 0 and set(hand.said) == {Go(251, MR1)}


def test_any_other_machine_is_released_by_an_order_of_its_own() -> None:
    hand = Hand(maker_of(SITE, CommandRequest("release", machine="MR1"), 6), [beat(MR1, MachineState.OBSTACLE)]).begin()
    hand.turn(2)
    assert hand.all(ManualOrder)


@pytest.mark.parametrize(
    ("reason", "told"),
    [(Reason.JOURNAL_LOST, "onboard operate regenerate"), (STOPPED, "holds by an emergency stop; onboard operate go")],
)
def test_what_release_cannot_mend_is_refused_with_the_command_that_can(reason: Reason, told: str) -> None:
    with pytest.raises(OperateError, match=told):
        Hand(maker_of(SITE, CommandRequest("release", machine="MR1"), 1), [halted(MR1, reason, needs_person=True)])
