"""Two site files count as one while an operator says so: who may say it, how long it holds, and how it ends."""

import dataclasses

import pytest

from onboard.contract.change import ChangePhase, SiteNext
from onboard.contract.codes import CONTRACT_VERSION, KindCode, MachineState, Reason
from onboard.contract.messages import BusTime, Heartbeat, Message
from onboard.core.effects import Effect, Send
from onboard.holon.holon import Holon
from onboard.systems.registry import factory_for
from onboard.wire.codec import fleet_codec
from tests.sites import one_floor

SITE = one_floor(robots=2)
STEWARD, ROBOT, OTHER, GHOST, OPERATOR = 1, 11, 12, 240, 251
OLD, NEXT = SITE.digest, SITE.digest ^ 0x0F0F
SECOND = 1_000_000


def robot() -> Holon:
    made = Holon(SITE, SITE.machines[ROBOT], factory_for(SITE, KindCode.ROBOT))
    made.listen(fleet_codec().speakers)
    made.start(0)
    made.receive(BusTime(STEWARD, 0), 0)
    return made


def beat(node: int, digest: int) -> Heartbeat:
    return Heartbeat(node, CONTRACT_VERSION, digest, 0, 1, KindCode.ROBOT, MachineState.IDLE)


def announced(sender: int = OPERATOR, phase: ChangePhase = ChangePhase.ANNOUNCED) -> SiteNext:
    return SiteNext(sender, OLD, NEXT, phase)


def told(effects: list[Effect]) -> list[Message]:
    return [one.message for one in effects if isinstance(one, Send) and isinstance(one.message, SiteNext)]


def woken(made: Holon, until_us: int) -> list[Message]:
    """What it says of the change until then, doing all that falls due."""
    said: list[Message] = []
    due_us = made.next_wake()
    while due_us is not None and due_us <= until_us:
        said += told(made.wake(due_us))
        due_us = made.next_wake()
    return said


def counts(made: Holon, now_us: int) -> bool:
    """Whether a machine of the other file counts: a stranger's heartbeat is dropped, and counted."""
    before = made.drops[Reason.OTHER_SITE]
    made.receive(beat(OTHER, NEXT), now_us)
    return made.drops[Reason.OTHER_SITE] == before and OTHER not in made.presence.foreign


def test_a_machine_of_the_announced_site_counts_until_it_is_over() -> None:
    made = robot()
    assert not counts(made, 1 * SECOND)
    heard = SiteNext(ROBOT, OLD, NEXT, ChangePhase.HEARD)
    assert told(made.receive(announced(), 2 * SECOND)) == [heard], "the operator is to see who has heard of it"
    assert told(made.receive(announced(), 4 * SECOND)) == [], "once"
    assert counts(made, 4 * SECOND + 1)
    made.receive(announced(phase=ChangePhase.OVER), 5 * SECOND)
    assert not counts(made, 6 * SECOND)


def test_it_is_said_again_every_ten_seconds_and_forgotten_ten_seconds_after_the_operator() -> None:
    made = robot()
    made.receive(announced(), 1 * SECOND)
    said: list[Message] = []
    for at_s in range(3, 25, 2):
        said += woken(made, at_s * SECOND)
        made.receive(announced(), at_s * SECOND)
    assert len(said) == 2, "said at 1 s, 11 s, 21 s"
    assert woken(made, 32 * SECOND) == [SiteNext(ROBOT, OLD, NEXT, ChangePhase.HEARD)] and counts(made, 32 * SECOND)
    woken(made, 34 * SECOND)
    assert not counts(made, 34 * SECOND), "the operator was heard last at 23 s"


def test_the_same_word_of_a_machine_that_has_the_next_file() -> None:
    made = robot()
    made.receive(SiteNext(OPERATOR, NEXT, OLD, ChangePhase.ANNOUNCED), SECOND)
    assert counts(made, 2 * SECOND)


@pytest.mark.parametrize(
    "word",
    [
        announced(STEWARD),
        announced(GHOST),
        SiteNext(OPERATOR, NEXT, NEXT ^ 1, ChangePhase.ANNOUNCED),
        SiteNext(OPERATOR, OLD, OLD, ChangePhase.ANNOUNCED),
        announced(phase=ChangePhase.HEARD),
    ],
    ids=["machine", "stranger", "of other sites", "of none", "no announcement"],
)
def test_what_makes_no_site_count(word: SiteNext) -> None:
    made = robot()
    assert told(made.receive(word, SECOND)) == []
    assert not counts(made, 2 * SECOND)


def test_an_end_of_another_change_ends_nothing() -> None:
    made = robot()
    made.receive(announced(), SECOND)
    made.receive(SiteNext(OPERATOR, OLD, NEXT ^ 1, ChangePhase.OVER), 2 * SECOND)
    assert counts(made, 3 * SECOND)


def test_whose_word_said_nothing_new_is_a_stranger_when_the_change_is_over() -> None:
    """The same heartbeat again and again, as a machine with nothing to do says it, is judged anew at the end."""
    made = robot()
    made.receive(announced(), SECOND)
    same = dataclasses.replace(beat(OTHER, NEXT), mirror_digest=made.mirror.digest())
    for half in range(3, 7):
        woken(made, half * SECOND // 2)
        made.receive(same, half * SECOND // 2)
        made.receive(announced(), half * SECOND // 2)
    assert not made.drops[Reason.OTHER_SITE], "it counts, and says nothing new"
    woken(made, 3_400_000)
    made.receive(announced(phase=ChangePhase.OVER), 3_400_000)
    woken(made, 3_500_000)
    made.receive(same, 3_500_000)
    assert made.drops[Reason.OTHER_SITE] == 1 and OTHER in made.presence.foreign
