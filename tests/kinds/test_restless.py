"""Two plans that answer each other: who says one after the other is behind itself, and asks nobody what it missed."""

from onboard.contract.codes import Grade, KindCode, LegAction, MachineState, Side
from onboard.contract.messages import Heartbeat, Itinerary, Leg, Message, Stamp, SyncRequest
from onboard.core.effects import Effect, Send
from onboard.holon.holon import Holon
from onboard.systems.registry import factory_for
from tests.kinds.board import OTHER, ROBOT, SITE

SECOND = 1_000_000


def plan(version: int) -> Itinerary:
    leg = Leg(LegAction.STAND, 1, 4, 4, Side.NEAR, 1_000 * version)
    return Itinerary(ROBOT, version, Grade.FIRM, Stamp(1_000, 1, 1), (leg,))


def asked(effects: list[Effect]) -> list[Message]:
    return [one.message for one in effects if isinstance(one, Send) and isinstance(one.message, SyncRequest)]


def after(words: int, now_us: int, *, is_telling: bool = False) -> list[Message]:
    """Whom a robot asks at ``now_us`` that has said so many plans, a second apart, where another's mirror differs."""
    holon = Holon(SITE, SITE.machines[ROBOT], factory_for(SITE, KindCode.ROBOT), boot=1)
    holon.start(0)
    holon.tokens.trust()
    beat = Heartbeat(OTHER, 1, SITE.digest, 0x1234, 1, KindCode.ROBOT, MachineState.IDLE, 0)
    holon.mirror.on_heartbeat(beat, 0)
    for number in range(1, words + 1):
        told = plan(number)
        holon.mirror.on_itinerary(told, number * SECOND)
        holon.witness.heed([Send(told)], number * SECOND)
    holon.witness.is_telling = lambda: is_telling
    holon.witness.on_heartbeat(beat, now_us, is_fresh=False)
    return asked(holon.witness.wake(now_us + SECOND))


def test_who_says_one_plan_after_the_other_asks_nobody_whose_mirror_differs() -> None:
    """On `harbour` one robot asked 49 machines for all they know at each answer of another's: a fifth of the bus."""
    assert after(1, 5 * SECOND) == [SyncRequest(ROBOT, OTHER, 0)]
    assert after(4, 5 * SECOND) == []
    assert after(4, 8 * SECOND) == [SyncRequest(ROBOT, OTHER, 0)], "it has come to rest"


def test_who_has_not_told_its_plan_to_its_end_asks_nobody_who_cannot_know_it() -> None:
    """A plan of 23 legs takes a second beyond its budget: from its middle a robot asked 20 machines with 943 cars."""
    assert after(1, 5 * SECOND, is_telling=True) == []
