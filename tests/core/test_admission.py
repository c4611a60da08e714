"""Who may say what: strangers, wrong kinds and wrong stewards come to nothing, are counted, and are named once."""

import pytest

from onboard.contract.codes import (
    CONTRACT_VERSION,
    KindCode,
    MachineState,
    ManualMode,
    OperatorAction,
    Reason,
    TokenKind,
)
from onboard.contract.messages import (
    Blocked,
    BusTime,
    Clear,
    Diagnostic,
    Go,
    Heartbeat,
    ManualOrder,
    Message,
    OperatorOrder,
    Reference,
    SyncRequest,
    TokenHeld,
)
from onboard.core.effects import Report, Send
from onboard.holon.holon import Holon
from onboard.systems.registry import factory_for
from onboard.ways.mirror import way_mirror
from onboard.wire.codec import fleet_codec
from tests.sites import one_floor

SITE = one_floor(robots=2)
STEWARD, ROBOT, OTHER, GHOST, OPERATOR = 1, 11, 12, 240, 251
TRACK = next(track for track, node in SITE.stewards.items() if node == STEWARD)
CAR = Reference(STEWARD, 1)


def robot() -> Holon:
    made = Holon(SITE, SITE.machines[ROBOT], factory_for(SITE, KindCode.ROBOT))
    made.listen(fleet_codec().speakers)
    made.start(0)
    made.receive(BusTime(STEWARD, 0), 0)
    return made


def beat(node: int, digest: int = SITE.digest) -> Heartbeat:
    return Heartbeat(node, CONTRACT_VERSION, digest, 0, 1, KindCode.ROBOT, MachineState.IDLE)


@pytest.mark.parametrize(
    ("said", "why"),
    [
        (TokenHeld(GHOST, TokenKind.SEGMENT, 0x103, 9), Reason.NOT_OF_SITE),
        (BusTime(GHOST, 3_600_000_000), Reason.NOT_OF_SITE),
        (beat(GHOST), Reason.NOT_OF_SITE),
        (Blocked(GHOST, TRACK, 3, Reason.OPERATOR), Reason.NOT_OF_SITE),
        (ManualOrder(GHOST, ROBOT, 1, ManualMode.HELD), Reason.NOT_OF_SITE),
        (SyncRequest(GHOST, ROBOT, 99), Reason.NOT_OF_SITE),
        (TokenHeld(OPERATOR, TokenKind.SEGMENT, 0x103, 9), Reason.NOT_OF_KIND),
        (ManualOrder(OTHER, ROBOT, 1, ManualMode.HELD), Reason.NOT_OF_KIND),
        (OperatorOrder(OTHER, STEWARD, OperatorAction.URGENT_TICKET, CAR), Reason.NOT_OF_KIND),
        (Go(OTHER, 0), Reason.NOT_OF_KIND),
        (BusTime(OTHER, 3_600_000_000), Reason.NOT_OF_KIND),
        (Blocked(OTHER, TRACK, 3, Reason.OPERATOR), Reason.NOT_OF_KIND),
        (Blocked(STEWARD, TRACK + 1, 3, Reason.OPERATOR), Reason.NOT_AUTHORISED),
        (Clear(STEWARD, TRACK + 1, 3, Reason.OPERATOR), Reason.NOT_AUTHORISED),
    ],
    ids=lambda one: type(one).__name__ if isinstance(one, Message) else one.name,
)
def test_what_its_sender_may_not_say_is_counted_told_and_changes_nothing(said: Message, why: Reason) -> None:
    made = robot()
    before = made.mirror.digest(), made.tokens.changes, made.presence.foreign, made.clock.bus_us(0)
    assert [type(effect) for effect in made.receive(said, 10)] == [Report], "people are told who"
    assert made.receive(said, 20) == [], "once"
    assert made.drops == {why: 2}
    assert (made.mirror.digest(), made.tokens.changes, made.presence.foreign, made.clock.bus_us(0)) == before
    due_us = made.next_wake()
    told: list[Message] = []
    while due_us is not None and due_us <= SITE.timing.heartbeat_us:
        told += [effect.message for effect in made.wake(due_us) if isinstance(effect, Send)]
        due_us = made.next_wake()
    assert Diagnostic(ROBOT, why, 2) in told


@pytest.mark.parametrize("sender", [STEWARD, OPERATOR])
def test_the_steward_and_an_operator_say_that_a_segment_is_blocked(sender: int) -> None:
    made = robot()
    made.receive(Blocked(sender, TRACK, 3, Reason.OPERATOR), 10)
    assert [segment.index for segment in way_mirror(made.mirror).obstacles.blocked] == [3]
    assert not made.drops


def test_strangers_have_no_vote_about_who_is_foreign() -> None:
    """One node can make up any number of machines of another site; a machine of mine that is wrong counts."""
    made = robot()
    for ghost in range(200, 250):
        made.receive(beat(ghost, digest=SITE.digest ^ 1), 10)
    assert not made.presence.is_held
    assert made.drops == {Reason.NOT_OF_SITE: 50}
    made.receive(beat(STEWARD, digest=SITE.digest ^ 1), 20)
    made.receive(beat(OTHER, digest=SITE.digest ^ 1), 30)
    assert made.presence.is_held, "two of three are of another site: I am the stranger"
