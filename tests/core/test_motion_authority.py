"""What permits motion, and what the holon does with an order that was made without it."""

from collections.abc import Callable
from dataclasses import dataclass, field

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import KindCode, LightColour, Reason
from onboard.contract.messages import DriveOrder, EmergencyStop, LightOrder, SyncRequest
from onboard.core.authority import TokenBook, TokenKey, segment_token
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Actuate, Effect, Halt, Tell
from onboard.core.mirror import Mirror
from onboard.core.motion_authority import ALONE, MotionAuthority, Permit, authorised
from onboard.core.negotiation import Estimator
from onboard.core.site import Machine, Segment, Site
from onboard.holon.holon import Holon
from onboard.work.plain import NoEstimator, Plain

SITE = find_site("small")
ME, PEER = sorted(SITE.machines)[-1], sorted(SITE.machines)[0]
MINE = segment_token(SITE.machines[ME].home)
THEIRS = segment_token(Segment(1, 1))
ORDER = DriveOrder(ME, 1, 1000, 500, across=False)

Ordering = Callable[["Eager"], list[Effect]]


@dataclass
class Eager(Plain):
    """Says to its devices what it is told to say, with the next message."""

    next: Ordering | None = None
    kept: list[Permit] = field(default_factory=list)

    def advance(self, now_us: int) -> list[Effect]:
        asked, self.next = self.next, None
        return asked(self) if asked is not None else []


class EagerFactory(BehaviourFactory):
    def estimator(self, site: Site, machine: Machine, mirror: Mirror) -> NoEstimator:
        return NoEstimator()

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> Eager:
        return Eager(fleet, KindCode.ROBOT)


class Bench:
    """One machine whose rights nobody disputes."""

    def __init__(self) -> None:
        self.holon = Holon(SITE, SITE.machines[ME], EagerFactory())
        assert isinstance(self.holon.behaviour, Eager)
        self.eager = self.holon.behaviour
        self.now_us = 1_000_000
        self.holon.start(self.now_us)
        self.holon.tokens.trust()

    def says(self, ordering: Ordering) -> list[Effect]:
        """What goes to the devices, or that the machine halts, when its behaviour does this."""
        self.eager.next = ordering
        self.now_us += 1000
        effects = self.holon.receive(SyncRequest(PEER, ME), self.now_us)
        return [effect for effect in effects if isinstance(effect, Actuate | Tell | Halt)]


def under(*rights: TokenKey) -> Ordering:
    """An order as it is to be made."""
    return lambda eager: authorised(eager.fleet.motion, rights).order(ORDER)


def test_an_order_under_a_right_in_hand_goes_out() -> None:
    assert [type(one) for one in Bench().says(under(MINE))] == [Actuate]


@pytest.mark.parametrize("rights", [[THEIRS], [MINE, THEIRS], [THEIRS, MINE]])
def test_nothing_is_ordered_where_one_of_the_rights_is_not_in_hand(rights: list[TokenKey]) -> None:
    assert Bench().says(under(*rights)) == []


def kept(eager: Eager) -> list[Effect]:
    """An order under an answer of the event before."""
    if eager.kept:
        return eager.kept[0].order(ORDER)
    eager.kept.append(authorised(eager.fleet.motion, [MINE]))
    return []


def given_away(eager: Eager) -> list[Effect]:
    """An order under a right that leaves with it."""
    order = authorised(eager.fleet.motion, [MINE]).order(ORDER)
    return order + eager.fleet.tokens.give(MINE, PEER, 0)


WRONG: dict[str, tuple[Ordering, str]] = {
    "made by hand": (lambda eager: [Actuate(ORDER, None)], "was not authorised"),
    "refused and sent all the same": (
        lambda eager: [Actuate(ORDER, authorised(eager.fleet.motion, [THEIRS]))],
        "was not authorised",
    ),
    "by the answer to another machine": (
        lambda eager: [Actuate(ORDER, authorised(MotionAuthority(TokenBook(SITE, ME)), [MINE]))],
        "was not authorised",
    ),
    "told as if nothing moved": (lambda eager: [Tell(ORDER)], "told as if it did not"),
    "under no right": (under(*ALONE), "needs a right"),
    "when its right leaves": (given_away, "is given away"),
    "an order of no system": (
        lambda eager: authorised(eager.fleet.motion, [MINE]).order(LightOrder(ME, LightColour.RED)),
        "no order of this system",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_machine_stops_at_an_order_that_did_not_pass_and_says_why(case: str) -> None:
    ordering, why = WRONG[case]
    (halt,) = Bench().says(ordering)
    assert isinstance(halt, Halt) and halt.reason is Reason.NOT_AUTHORISED and why in halt.why


def test_an_answer_is_good_for_its_own_event_only() -> None:
    bench = Bench()
    assert bench.says(kept) == []
    (halt,) = bench.says(kept)
    assert isinstance(halt, Halt) and "was not authorised" in halt.why


def test_a_light_moves_nothing_and_needs_nothing() -> None:
    assert [type(one) for one in Bench().says(lambda eager: [Tell(LightOrder(ME, LightColour.RED))])] == [Tell]


def test_a_held_machine_may_not_move_and_says_what_holds_it() -> None:
    bench = Bench()
    assert authorised(bench.eager.fleet.motion, ALONE).reason is Reason.NONE
    bench.holon.receive(EmergencyStop(PEER, Reason.OPERATOR), bench.now_us)
    assert authorised(bench.eager.fleet.motion, [MINE]).reason is Reason.EMERGENCY_STOP


def test_what_the_machine_has_against_it_comes_before_what_others_have() -> None:
    motion = MotionAuthority(TokenBook(SITE, ME))
    assert authorised(motion, [THEIRS], Reason.POSITION_UNKNOWN).reason is Reason.POSITION_UNKNOWN
    here = authorised(motion, [MINE])
    assert authorised(motion, [THEIRS], besides=here).reason is Reason.NOT_AUTHORISED
    assert authorised(motion, [MINE], besides=here.unless(Reason.NO_FRESH_PROOF)).reason is Reason.NO_FRESH_PROOF
