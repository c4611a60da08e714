"""regenerate: what is made anew, in which order, and everything that breaks it off before it counts."""

from collections.abc import Callable

import pytest

from onboard.contract.assignments import assignment_digest
from onboard.contract.codes import CONTRACT_VERSION, MachineState, Reason, RegenerationPhase, TokenKind
from onboard.contract.constants import ANY_STATION
from onboard.contract.messages import (
    Blocked,
    CarAt,
    Heartbeat,
    Message,
    Progress,
    Reference,
    Regeneration,
    RegenerationState,
    TokenAssigned,
    TokenHeld,
    TokenSeen,
)
from onboard.core.authority import TokenKey, genesis_holder, segment_token
from onboard.core.site import Segment
from onboard.operate.commands import CommandRequest, maker_of
from onboard.operate.names import OperateError
from onboard.ways.site import way_site
from tests.operate.hand import ALL, SECOND, SITE, Hand, beat, halted

MR1, MR2 = SITE.machine("MR1").node_id, SITE.machine("MR2").node_id
ER1, ER2 = SITE.machine("ER1").node_id, SITE.machine("ER2").node_id
FREEZE, READ_BACK = RegenerationPhase.FREEZE, RegenerationPhase.READ_BACK
COMMIT, ABORT = RegenerationPhase.COMMIT, RegenerationPhase.ABORT


class Machines:
    """All machines of the site but ``without``, as docs/protocol.md lets them answer."""

    def __init__(self, hand: Hand, *words: Message, without: tuple[int, ...] = ()) -> None:
        self.hand, self.words = hand, words
        self.nodes = [node for node in ALL if node not in without]
        self.lists: dict[int, dict[TokenKey, TokenAssigned]] = {node: {} for node in self.nodes}
        self.epochs = dict.fromkeys(self.nodes, 0)
        #: Turns a machine's answer into another, or into none.
        self.bend: Callable[[Message], Message | None] = lambda message: message

    def turn(self, seconds: float) -> None:
        """Tenths of a second: what was said is answered, and everybody beats."""
        for tenth in range(round(seconds * 10)):
            due_us = self.hand.order.next_wake()
            said = self.hand.order.wake(self.hand.now_us) if due_us is not None and due_us <= self.hand.now_us else []
            self.hand.said += said
            self.hand.now_us += SECOND // 10
            for word in said:
                self._hear(word)
            if tenth % 10 == 0:
                for node in self.nodes:
                    self._say(self._beat(node))
            self.hand.lines += self.hand.order.news()

    def _hear(self, word: Message) -> None:
        for node in self.nodes:
            if isinstance(word, TokenAssigned):
                self.lists[node][TokenKey(word.token_kind, word.token)] = word
            elif isinstance(word, Regeneration):
                self._answer(node, word)

    def _answer(self, node: int, word: Regeneration) -> None:
        if word.regeneration_phase is FREEZE:
            own = [one for one in self.words if one.sender == node]
            for one in own:
                self._say(one)
            counted = len({(one.token_kind, one.token) for one in own if isinstance(one, TokenHeld | TokenSeen)})
            self._say(RegenerationState(node, FREEZE, word.epoch, counted, 0, Reason.NONE))
        elif word.regeneration_phase is READ_BACK:
            known = self.lists[node].values()
            digest = assignment_digest(known)
            self._say(RegenerationState(node, READ_BACK, word.epoch, len(known), digest, Reason.NONE))
        elif word.regeneration_phase is COMMIT:
            self.epochs[node] = word.epoch

    def _beat(self, node: int) -> Heartbeat:
        kind = SITE.machines[node].kind
        return Heartbeat(node, CONTRACT_VERSION, SITE.digest, 0, 1, kind, MachineState.OBSTACLE, self.epochs[node])

    def _say(self, message: Message) -> None:
        bent = self.bend(message)
        if bent is not None:
            self.hand.hear(bent)


def held(node: int, slot: Segment, version: int) -> TokenHeld:
    return TokenHeld(node, TokenKind.SEGMENT, slot.number, version)


def seen(node: int, slot: Segment, version: int, holder: int) -> TokenSeen:
    return TokenSeen(node, TokenKind.SEGMENT, slot.number, version, holder)


#: MR1 stands in p(1,3), half in p(1,4), as a person sees; it was given these by their steward, and MR2 holds one.
HERE, NEXT, LEFT, OTHERS = Segment(1, 3), Segment(1, 4), Segment(1, 2), Segment(1, 8)
STEWARD = SITE.stewards[1]
PLACE = Progress(MR1, 1, 0, 1, 3, 900, 0)
BODY = (PLACE, seen(STEWARD, HERE, 4, MR1), seen(STEWARD, NEXT, 6, MR1))
WORDS = (
    *BODY,
    held(MR2, OTHERS, 7),
    seen(STEWARD, LEFT, 9, MR1),
    seen(MR2, LEFT, 8, MR1),
)


def started(
    *words: Message, command: CommandRequest | None = None, without: tuple[int, ...] = ()
) -> tuple[Hand, Machines]:
    make = maker_of(SITE, command or CommandRequest("regenerate", machine="MR1", body=("p(1,3)", "p(1,4)")), 1)
    hand = Hand(make, [beat(node) for node in ALL if node not in without]).begin()
    return hand, Machines(hand, *(words or WORDS), without=without)


def phases(hand: Hand) -> list[RegenerationPhase]:
    told: list[RegenerationPhase] = []
    for one in hand.said:
        if isinstance(one, Regeneration) and one.regeneration_phase not in told[-1:]:
            told.append(one.regeneration_phase)
    return told


def assigned(hand: Hand) -> dict[TokenKey, tuple[int, int]]:
    return {
        TokenKey(one.token_kind, one.token): (one.version, one.holder)
        for one in hand.said
        if isinstance(one, TokenAssigned)
    }


def test_the_lost_rights_are_made_anew_above_every_version_and_nobody_elses() -> None:
    hand, machines = started()
    machines.turn(2)
    assert hand.order.has_question and "rights be made anew under epoch 1" in hand.order.question
    assert any(line == "MR1 gets 2 segments" for line in hand.lines), hand.lines
    hand.order.answered(hand.now_us, agrees=True)
    machines.turn(10)
    assert hand.order.status == 0 and "MR1 is in epoch 1" in hand.lines
    assert phases(hand) == [FREEZE, READ_BACK, COMMIT]
    anew = assigned(hand)
    assert anew[segment_token(HERE)] == anew[segment_token(NEXT)] == (10, MR1), "above all of their track"
    assert anew[segment_token(LEFT)] == (10, STEWARD), "its body is not there: it goes back to its first holder"
    assert segment_token(OTHERS) not in anew
    mine = [key for key in anew if genesis_holder(SITE, key) != MR1 and key.kind is TokenKind.SEGMENT]
    assert set(mine) == {segment_token(slot) for slot in (HERE, NEXT, LEFT)}, (
        "what never moved is with who had it first"
    )


@pytest.mark.parametrize(
    ("body", "wrong", "whose"),
    [(OTHERS, "p(1,8)", "MR2"), (Segment(1, 6), "p(1,6)", "IOC1")],
    ids=["another robot's", "its steward's, that never moved"],
)
def test_a_body_where_somebody_else_has_the_right_to_be_is_a_mistake(body: Segment, wrong: str, whose: str) -> None:
    hand, machines = started(command=CommandRequest("regenerate", machine="MR1", body=("p(1,3)", str(body))))
    machines.turn(5)
    told = f"--body {wrong}: {whose} holds it, so MR1 cannot be there: look again; "
    assert told + "by the words of the others it may be in p(1,2), p(1,3), p(1,4)" in hand.lines
    assert hand.order.status == 2 and phases(hand) == [FREEZE, ABORT] and not assigned(hand)


def test_a_body_where_another_machine_says_to_be_is_refused_before_anything_is_said() -> None:
    make = maker_of(SITE, CommandRequest("regenerate", machine="MR1", body=("p(1,8)",)), 1)
    with pytest.raises(OperateError, match=r"--body p\(1,8\): MR2 is there by its own word; look again"):
        Hand(make, [*(beat(node) for node in ALL), Progress(MR2, 1, 0, 1, 8, 0, 0)])


def test_a_machine_with_somebody_elses_journal_cannot_be_regenerated() -> None:
    make = maker_of(SITE, CommandRequest("regenerate", machine="MR1", body=("p(1,3)",)), 1)
    with pytest.raises(OperateError, match="MR2: its journal is another machine's: put the right board"):
        Hand(make, [*(beat(node) for node in ALL), halted(MR2, Reason.JOURNAL_FOREIGN, needs_person=True)])


def test_all_stand_frozen_while_the_person_reads_and_no_is_no() -> None:
    hand, machines = started()
    machines.turn(60)
    assert not hand.is_over() and phases(hand) == [FREEZE]
    assert 55 <= len(hand.said) <= 65, "FREEZE once a second"
    hand.order.answered(hand.now_us, agrees=False)
    machines.turn(5)
    assert hand.order.status == 1 and phases(hand) == [FREEZE, ABORT] and not assigned(hand)


def test_nobody_answers_for_five_minutes_and_it_is_broken_off() -> None:
    hand, machines = started()
    machines.turn(310)
    assert hand.order.status == 1 and "nobody has answered" in hand.lines


def its_car(*, at: Segment) -> tuple[Message, ...]:
    """MR1 had a car aboard, and the right to a place beside ``at``, by all that MR2 knows."""
    place = next(place for place in way_site(SITE).places if place.segment == at)
    car = Reference(1, 7)
    return (
        CarAt(MR2, car, ANY_STATION, 3, 2_700),
        TokenSeen(MR2, TokenKind.CAR, car.origin << 16 | car.number, 3, MR1),
        TokenSeen(MR2, TokenKind.STATION, place.number, 2, MR1),
    )


def test_a_robot_is_brought_back_where_it_may_have_left_its_car() -> None:
    """It puts a car down, and loses that word: the place would be another's, and a car stands in it."""
    hand, machines = started(*BODY, *its_car(at=LEFT))
    machines.turn(5)
    assert hand.order.status == 2 and not assigned(hand)
    assert any("MR1 may have left car 1.7 at p(1,2)" in line and "push it to p(1,2)" in line for line in hand.lines)
    hand, machines = started(*BODY, *its_car(at=HERE))
    machines.turn(2)
    assert hand.order.has_question


def test_where_the_car_of_an_absent_machine_may_stand_is_told_before_it_is_asked() -> None:
    hand, machines = started(*WORDS[1:], *its_car(at=LEFT), command=absent(), without=(MR1,))
    machines.turn(2)
    assert any("car 1.7 was aboard MR1" in line and "may stand at p(1,2)" in line for line in hand.lines)


def test_a_grant_on_its_way_to_who_lives_becomes_that_machines() -> None:
    """Its giver says so; the old grant is older than what everybody has read."""
    hand, machines = started(*BODY, seen(STEWARD, LEFT, 9, MR2))
    machines.turn(2)
    hand.order.answered(hand.now_us, agrees=True)
    machines.turn(5)
    assert assigned(hand)[segment_token(LEFT)] == (10, MR2)


def test_a_car_goes_to_who_keeps_its_place() -> None:
    car = Reference(1, 7)
    place = next(place for place in way_site(SITE).places if place.track == 3)
    key = TokenKey(TokenKind.CAR, car.origin << 16 | car.number)
    hand, machines = started(
        *BODY,
        CarAt(MR2, car, place.number, 3, 2_700),
        TokenSeen(MR2, TokenKind.CAR, key.number, 3, MR1),
    )
    machines.turn(2)
    hand.order.answered(hand.now_us, agrees=True)
    machines.turn(5)
    assert assigned(hand)[key] == (4, SITE.stewards[3])


def test_an_absent_body_on_a_platform_keeps_platform_and_gate_from_all() -> None:
    lift = SITE.machine("ER1").home.track
    words = (seen(ER1, Segment(lift, 0), 4, MR1), seen(ER1, Segment(lift, 255), 5, MR1))
    hand, machines = started(*words, command=absent("ER1"), without=(MR1,))
    machines.turn(2)
    hand.order.answered(hand.now_us, agrees=True)
    machines.turn(5)
    assert not {segment_token(Segment(lift, 0)), segment_token(Segment(lift, 255))} & set(assigned(hand))


def test_a_lost_steward_gets_back_what_it_did_not_give_away() -> None:
    given = Segment(1, 6)
    command = CommandRequest("regenerate", machine=SITE.machines[STEWARD].name)
    hand, machines = started(held(MR2, given, 3), command=command)
    machines.turn(2)
    hand.order.answered(hand.now_us, agrees=True)
    machines.turn(10)
    anew = assigned(hand)
    assert hand.order.status == 0 and segment_token(given) not in anew
    assert anew[segment_token(Segment(1, 5))] == (4, STEWARD)


def test_what_the_lost_machine_says_to_hold_is_not_believed() -> None:
    hand, machines = started(*BODY, held(MR1, OTHERS, 3), held(MR2, OTHERS, 4))
    machines.turn(2)
    assert hand.order.has_question


@pytest.mark.parametrize(
    "words",
    [(held(MR2, LEFT, 4), held(ER2, LEFT, 5)), (held(MR2, LEFT, 4), seen(ER2, LEFT, 6, ER1))],
    ids=["two holders", "an older version than another knows"],
)
def test_journals_that_do_not_agree_break_it_off(words: tuple[Message, ...]) -> None:
    hand, machines = started(*BODY, *words)
    machines.turn(5)
    assert hand.order.status == 1 and phases(hand) == [FREEZE, ABORT]
    assert any("do not agree about segment 0x0102" in line and "MR2" in line for line in hand.lines)


def test_what_was_given_away_before_its_holder_stood_is_not_held_by_two() -> None:
    """Its giver said that it holds it right before, and was then asked for it."""
    hand, machines = started(*BODY, held(STEWARD, LEFT, 4), seen(STEWARD, LEFT, 5, MR2), held(MR2, LEFT, 5))
    machines.bend = lambda one: None if isinstance(one, RegenerationState) else one
    machines.turn(1)
    machines.bend = lambda one: None if one == held(STEWARD, LEFT, 4) else one
    machines.turn(2)
    assert hand.order.has_question, hand.lines


def refused(message: Message) -> Message:
    if isinstance(message, RegenerationState) and message.sender == MR2:
        return RegenerationState(MR2, RegenerationPhase.REFUSED, message.epoch, 0, 0, Reason.FALSE_STATEMENT)
    return message


def silent(message: Message) -> Message | None:
    return None if message.sender == MR2 else message


def restarted(message: Message) -> Message:
    return beat(MR2, boot=2) if isinstance(message, Heartbeat) and message.sender == MR2 else message


def another_tool(message: Message) -> Message:
    return Regeneration(252, FREEZE, 1, MR2, 0, 0, 0) if message.sender == MR2 else message


def other_list(message: Message) -> Message:
    if isinstance(message, RegenerationState) and message.regeneration_phase is READ_BACK and message.sender == MR2:
        return RegenerationState(MR2, READ_BACK, message.epoch, message.tokens, message.digest ^ 1, Reason.NONE)
    return message


@pytest.mark.parametrize(
    ("bend", "told"),
    [
        (refused, "MR2 refuses: false statement"),
        (silent, "not all have said what they hold: MR2"),
        (restarted, "MR2 was started again meanwhile"),
        (another_tool, "node 252 regenerates as well"),
        (other_list, "not all have read the list back: MR2"),
    ],
)
def test_whatever_speaks_against_it_breaks_it_off_before_it_counts(
    bend: Callable[[Message], Message | None], told: str
) -> None:
    hand, machines = started()
    machines.bend = bend
    machines.turn(20)
    hand.order.answered(hand.now_us, agrees=True)
    machines.turn(60)
    assert hand.order.status == 1 and told in hand.lines, hand.lines
    assert COMMIT not in phases(hand) and phases(hand)[-1] is ABORT


def test_all_are_waited_for_while_more_is_said() -> None:
    """A full park on a slow bus needs longer for what all hold than anybody is waited for who says nothing."""
    hand, machines = started(*WORDS, *(held(MR2, Segment(2, index), 1) for index in range(1, 9)))
    track = Segment(2, 0).number
    machines.bend = lambda one: None if isinstance(one, TokenHeld) and one.token > track + said else one
    for said in range(1, 9):
        machines.turn(2)
        assert (hand.order.status, phases(hand)) == (None, [FREEZE]), hand.lines
        assert hand.order.has_question is (said == 8)


def test_who_missed_a_frame_is_told_the_list_again() -> None:
    hand, machines = started()
    machines.turn(2)
    hand.order.answered(hand.now_us, agrees=True)
    machines.turn(0.1)
    machines.lists[MR2].popitem()
    machines.turn(10)
    assert hand.order.status == 0 and hand.said.count(hand.said[-1]) >= 1
    assert max(map(hand.said.count, hand.all(TokenAssigned))) == 2


def absent(body: str = "p(1,3)") -> CommandRequest:
    return CommandRequest("regenerate", machine="MR1", absent="MR1", body=(body,))


def test_an_absent_machine_is_typed_by_name_and_its_slots_stay_blocked_and_nobodys() -> None:
    hand, machines = started(*WORDS[1:], command=absent(), without=(MR1,))
    assert hand.order.answer == "MR1" and "padlock" in hand.order.question
    machines.turn(2)
    assert hand.order.answer == ""
    hand.order.answered(hand.now_us, agrees=True)
    machines.turn(5)
    anew = assigned(hand)
    assert hand.order.status == 0 and Blocked(251, 1, 3, Reason.OPERATOR) in hand.said
    assert segment_token(HERE) not in anew and anew[segment_token(NEXT)] == (10, STEWARD)
    assert MR1 not in {holder for _, holder in anew.values()}


def test_an_absent_machine_that_lives_is_found_out() -> None:
    hand, machines = started(*WORDS[1:], command=absent(), without=(MR1,))
    machines.turn(2)
    hand.hear(Progress(MR1, 1, 0, 1, 3, 0, 0))
    machines.turn(5)
    assert hand.order.status == 1 and phases(hand)[-1] is ABORT
    assert "MR1 LIVES though it is said to be locked off (Progress): go and see" in hand.lines


def test_an_absent_machine_that_lives_at_the_beginning_is_found_out_before_a_word() -> None:
    hand = Hand(maker_of(SITE, absent(), 1), [beat(node) for node in ALL]).begin()
    assert hand.order.status == 1 and hand.order.news() == ["MR1 lives: it is not absent"] and not hand.said


def test_a_machine_that_is_only_silent_is_not_passed_over() -> None:
    make = maker_of(SITE, CommandRequest("regenerate", machine="MR1", body=("p(1,3)",)), 1)
    hand = Hand(make, [beat(node) for node in ALL if node != MR2])
    hand.begin()
    assert hand.order.status == 1
    assert hand.order.news() == ["MR2 is not heard: start it, or lock it off and name it with --absent MR2"]


def test_the_person_breaks_it_off_and_all_are_told() -> None:
    hand, machines = started()
    machines.turn(2)
    (word,) = hand.order.interrupt(hand.now_us)
    assert isinstance(word, Regeneration) and word.regeneration_phase is ABORT and hand.order.status == 1


def test_who_does_not_take_up_the_new_epoch_is_named() -> None:
    hand, machines = started()
    machines.turn(2)
    hand.order.answered(hand.now_us, agrees=True)
    machines.bend = lambda one: beat(MR2) if isinstance(one, Heartbeat) and one.sender == MR2 else one
    machines.turn(20)
    assert hand.order.status == 1 and "not confirmed by MR2" in hand.lines


MISTAKES = [
    (CommandRequest("regenerate", machine="MR1", absent="MR1"), "MR1: where does it stand"),
    (CommandRequest("regenerate", machine="MR1"), "MR1: where does it stand"),
    (CommandRequest("regenerate", machine="MR1", body=("gone",)), "must stand on one track"),
    (CommandRequest("regenerate", machine="MR1", body=("ER1", "ER2")), "must stand on one track"),
    (CommandRequest("regenerate", machine="MR1", body=("p(1,3)", "p(2,3)")), "must stand on one track"),
    (CommandRequest("regenerate", machine="MR1", body=("p(1,3)",), absent="MR2"), "MR2: where does it stand"),
    (CommandRequest("regenerate", machine="MR1", absent="MR1", body=("p(7,3)",)), "no segment"),
]


@pytest.mark.parametrize(("command", "told"), MISTAKES)
def test_a_mistake_is_told_before_anything_is_said(command: CommandRequest, told: str) -> None:
    with pytest.raises(OperateError, match=told):
        maker_of(SITE, command, 1)
