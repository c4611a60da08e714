"""State charts of what the code keeps without a table: each arrow is walked by a test with the code itself."""

from collections.abc import Callable, Iterable
from typing import NamedTuple

from onboard.contract.codes import CONTRACT_VERSION, Grade, KindCode, LegAction, MachineState, Reason, Side
from onboard.contract.messages import (
    Halted,
    Heartbeat,
    Itinerary,
    Leg,
    Stamp,
    SyncDone,
    TokenGiven,
    TokenGrant,
    TokenHeld,
    TokenRefusal,
    TokenRequest,
)
from onboard.core.authority import TokenBook, segment_token
from onboard.core.effects import Effect, Record, Send
from onboard.core.site import Segment
from onboard.holon.presence import Presence
from onboard.holon.witness import Witness
from onboard.ways.mirror import WayMirror
from tests.sites import one_floor

SITE = one_floor(robots=2)
STEWARD, ALICE, BOB = 1, 11, 12
KEY = segment_token(Segment(1, 7))
BEAT_US = SITE.timing.heartbeat_us
NUMBER = KEY.number


class Walker:
    """One node with what it keeps of one token (``ALICE``'s view), of one machine (``BOB``), and of its own sync."""

    def __init__(self, boot: int = 2) -> None:
        self.book = TokenBook(SITE, ALICE)
        self.mirror = WayMirror(SITE, ALICE)
        self.presence = Presence(SITE, ALICE, self.mirror, self.book)
        self.presence.review(0)
        self.witness = Witness(self.book, self.mirror, boot, boot > 1, lambda _: self.book.statements())

    @property
    def token(self) -> str:
        """The state in the chart of a token."""
        if self.book.holds(KEY):
            return "HELD"
        if KEY in self.book.leaving:
            return "LEAVING"
        return "WANTED" if KEY in self.book.wanted else "ELSEWHERE"

    @property
    def other(self) -> str:
        """The state in the chart of presence."""
        if BOB in self.mirror.aside:
            return "OBSTACLE"
        return "TAKES_PART" if BOB in self.mirror.peers else "UNKNOWN"

    @property
    def sync(self) -> str:
        """The state in the chart of a restart."""
        if self.witness.doubt is not None:
            return "IN_DOUBT"
        return "TRUSTS" if self.witness.is_over else "ASKS"

    def beat(self, state: MachineState = MachineState.IDLE, boot: int = 1, at_us: int = 0) -> list[Effect]:
        """BOB's heartbeat."""
        word = Heartbeat(BOB, CONTRACT_VERSION, SITE.digest, 0, boot, KindCode.ROBOT, state, 0)
        self.presence.heard_beat(word)
        self.mirror.on_heartbeat(word, at_us)
        self.presence.heard(BOB, at_us)
        self.presence.review(at_us)
        return []

    def plan(self) -> list[Effect]:
        """BOB's plan."""
        leg = Leg(LegAction.STAND, 1, 7, 7, Side.NEAR, 1)
        self.mirror.on_itinerary(Itinerary(BOB, 1, Grade.FIRM, Stamp(0, BOB, 0), (leg,)), BEAT_US * 9)
        self.presence.heard(BOB, BEAT_US * 9)
        return []

    def review(self, at_us: int) -> list[Effect]:
        """Look at all others."""
        self.presence.review(at_us)
        return []

    def halted(self) -> list[Effect]:
        """BOB says that it does nothing."""
        self.presence.heard_halted(Halted(BOB, BOB, Reason.EMERGENCY_STOP, 0, False, 1), 0)
        return []

    def foreign(self) -> list[Effect]:
        """BOB's heartbeat has another contract."""
        self.presence.heard_foreign(BOB, Reason.OTHER_CONTRACT, 0)
        return []

    def know_all(self) -> list[Effect]:
        """The two others live."""
        for node in (STEWARD, BOB):
            kind = SITE.machines[node].kind
            self.mirror.on_heartbeat(
                Heartbeat(node, CONTRACT_VERSION, SITE.digest, 0, 1, kind, MachineState.IDLE, 0), BEAT_US
            )
        return []

    def done(self, node: int) -> list[Effect]:
        """A machine has said all."""
        return self.witness.on_done(SyncDone(node, 0, 1, 0), BEAT_US)

    def hear_of_token(self) -> list[Effect]:
        """Somebody has my right under a version that the journal lacks."""
        home = segment_token(SITE.machines[ALICE].home)
        self.witness.hear(TokenHeld(STEWARD, home.kind, home.number, 5), BEAT_US)
        return []


Step = Callable[[Walker], list[Effect]]


class Edge(NamedTuple):
    """One arrow: upon ``event``, ``deed`` is done ("" for nothing)."""

    state: str
    event: str
    following: str
    deed: str


class Walk(NamedTuple):
    """An arrow of a chart, and how it is walked: what is before it, then the event."""

    state: str
    event: str
    following: str
    said: str
    before: tuple[Step, ...]
    step: Step


def edges(walks: Iterable[Walk]) -> tuple[Edge, ...]:
    """The arrows alone."""
    return tuple(Edge(*walk[:4]) for walk in walks)


def spoken(effects: Iterable[Effect]) -> str:
    """What is journalled and said, as the arrow's label has it."""
    names = []
    for one in effects:
        if isinstance(one, Record):
            names.append("journal")
        elif isinstance(one, Send):
            names.append(type(one.message).__name__)
    return ", ".join(names)


def _wants(walker: Walker) -> list[Effect]:
    return walker.book.want(KEY, 0)


def _granted(walker: Walker) -> list[Effect]:
    return walker.book.on_grant(TokenGrant(STEWARD, KEY.kind, NUMBER, 1, ALICE), 0)


def _granted_by_another(walker: Walker) -> list[Effect]:
    return walker.book.on_grant(TokenGrant(BOB, KEY.kind, NUMBER, 2, ALICE), 0)


def _gives(walker: Walker) -> list[Effect]:
    return walker.book.give(KEY, BOB, 10)


def _refused(walker: Walker) -> list[Effect]:
    refusal = TokenRefusal(STEWARD, KEY.kind, NUMBER, 0, ALICE, Reason.TOKEN_NOT_GRANTABLE_YET)
    walker.book.on_refusal(refusal, 0)
    return []


def _needs_no_more(walker: Walker) -> list[Effect]:
    walker.book.forget(KEY)
    return []


def _request(verdict: Reason) -> Step:
    def step(walker: Walker) -> list[Effect]:
        return walker.book.on_request(TokenRequest(BOB, KEY.kind, NUMBER, 0, 0, 0), verdict, 10)

    return step


_HELD = (_wants, _granted)
_LEFT = (*_HELD, _gives)
#: What one node keeps of one token.
TOKEN = (
    Walk("ELSEWHERE", "its plan needs it", "WANTED", "TokenRequest", (), _wants),
    Walk(
        "WANTED",
        "repeat is due",
        "WANTED",
        "TokenRequest",
        (_wants,),
        lambda one: one.book.wake(SITE.timing.token_repeat_us),
    ),
    Walk(
        "WANTED",
        "TokenRefusal of its holder",
        "WANTED",
        "",
        (_wants,),
        _refused,
    ),
    Walk(
        "WANTED",
        "not needed any more",
        "ELSEWHERE",
        "",
        (_wants,),
        _needs_no_more,
    ),
    Walk("WANTED", "TokenGrant from the believed holder", "HELD", "journal, TokenHeld", (_wants,), _granted),
    Walk("ELSEWHERE", "TokenGrant from the believed holder", "HELD", "journal, TokenHeld", (), _granted),
    Walk("WANTED", "TokenGrant from another", "WANTED", "TokenDispute", (_wants,), _granted_by_another),
    Walk(
        "WANTED",
        "TokenGiven of the believed holder to the disputed giver",
        "HELD",
        "journal, TokenHeld",
        (_wants, _granted_by_another),
        lambda one: one.book.on_given(TokenGiven(STEWARD, KEY.kind, NUMBER, 1, BOB), 0),
    ),
    Walk("HELD", "the same TokenGrant again", "HELD", "TokenHeld", _HELD, _granted),
    Walk(
        "HELD",
        "TokenRequest that must wait",
        "HELD",
        "TokenRefusal",
        _HELD,
        _request(Reason.TOKEN_NOT_GRANTABLE_YET),
    ),
    Walk(
        "HELD",
        "TokenHeld of another",
        "HELD",
        "TokenHeld",
        _HELD,
        lambda one: one.book.on_held(TokenHeld(BOB, KEY.kind, NUMBER, 4), 0),
    ),
    Walk("HELD", "TokenRequest whose turn it is", "LEAVING", "journal, TokenGrant", _HELD, _request(Reason.NONE)),
    Walk("HELD", "not needed any more", "LEAVING", "journal, TokenGrant", _HELD, _gives),
    Walk(
        "LEAVING",
        "repeat is due",
        "LEAVING",
        "TokenGrant",
        _LEFT,
        lambda one: one.book.wake(10 + SITE.timing.token_repeat_us),
    ),
    Walk(
        "LEAVING",
        "TokenHeld of the new holder",
        "ELSEWHERE",
        "journal",
        _LEFT,
        lambda one: one.book.on_held(TokenHeld(BOB, KEY.kind, NUMBER, 2), 20),
    ),
    Walk(
        "LEAVING",
        "TokenGrant back from the new holder",
        "HELD",
        "journal, TokenHeld",
        _LEFT,
        lambda one: one.book.on_grant(TokenGrant(BOB, KEY.kind, NUMBER, 3, ALICE), 20),
    ),
)

_SILENT = (Walker.beat, lambda one: one.review(4 * BEAT_US))
#: What one machine keeps of another.
PRESENCE = (
    Walk("UNKNOWN", "Heartbeat of this contract, site and epoch", "TAKES_PART", "", (), Walker.beat),
    Walk("UNKNOWN", "not heard for T_silent", "OBSTACLE", "", (), lambda one: one.review(4 * BEAT_US)),
    Walk("TAKES_PART", "not heard for T_silent", "OBSTACLE", "", (Walker.beat,), lambda one: one.review(4 * BEAT_US)),
    Walk(
        "TAKES_PART",
        "Heartbeat with state OBSTACLE or STOPPED",
        "OBSTACLE",
        "",
        (Walker.beat,),
        lambda one: one.beat(MachineState.OBSTACLE),
    ),
    Walk("TAKES_PART", "its own Halted", "OBSTACLE", "", (Walker.beat,), Walker.halted),
    Walk("TAKES_PART", "Heartbeat of another contract, site or epoch", "OBSTACLE", "", (Walker.beat,), Walker.foreign),
    Walk(
        "OBSTACLE",
        "Heartbeat of a mobile machine without a plan",
        "OBSTACLE",
        "",
        _SILENT,
        lambda one: one.beat(at_us=9 * BEAT_US),
    ),
    Walk(
        "OBSTACLE",
        "FIRM Itinerary, and heard",
        "TAKES_PART",
        "",
        (*_SILENT, lambda one: one.beat(at_us=9 * BEAT_US)),
        Walker.plan,
    ),
)


def _begin(walker: Walker) -> list[Effect]:
    walker.know_all()
    return walker.witness.begin(0)


def _asks_again(walker: Walker) -> list[Effect]:
    return walker.witness.wake(2 * BEAT_US)


#: What a machine that was started keeps of its rights until all have answered.
SYNC = (
    Walk("ASKS", "no answer of some that live", "ASKS", "SyncRequest, SyncRequest", (_begin,), _asks_again),
    Walk("ASKS", "SyncDone of one, others are missing", "ASKS", "", (_begin,), lambda one: one.done(BOB)),
    Walk(
        "ASKS",
        "SyncDone of the last that lives, T_beat over",
        "TRUSTS",
        "",
        (_begin, lambda one: one.done(BOB)),
        lambda one: one.done(STEWARD),
    ),
    Walk(
        "ASKS",
        "a newer version of a right of mine",
        "IN_DOUBT",
        "",
        (_begin,),
        Walker.hear_of_token,
    ),
)
