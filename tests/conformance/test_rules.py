"""Each rule by which a system's logs are judged finds what it is for, and nothing where nothing is wrong."""

from collections.abc import Iterable

import pytest

from bus_sim.options import RunOptions
from bus_sim.session import play
from onboard.contract.codes import (
    CONTRACT_VERSION,
    CallResult,
    Criterion,
    KindCode,
    MachineState,
    ManualMode,
    Operation,
    Reason,
    TokenKind,
)
from onboard.contract.constants import MOBILE_KINDS
from onboard.contract.messages import (
    NO_REFERENCE,
    Award,
    CallForProposals,
    Heartbeat,
    ManualOrder,
    ManualState,
    Message,
    Reference,
    TokenHeld,
)
from onboard.core.site import Site
from onboard.trace.check.holds import FORGOTTEN_US, MOST_WORDS, HoldAnswered, LetGoAgain
from onboard.trace.check.systems import rules_for
from tests.conformance.case import Case
from tests.conformance.cases import CASES, every_system
from tests.faults.systems import judged

SECOND = 1_000_000
#: They have nothing to judge where nobody has a hand in.
BY_HAND = {HoldAnswered, LetGoAgain}
CALL = 4


def a_second_apart(messages: Iterable[Message]) -> list[tuple[int, Message]]:
    return [(SECOND * number, one) for number, one in enumerate(messages, start=1)]


def common(case: Case) -> dict[str, list[tuple[int, Message]]]:
    """What breaks each rule that is everybody's once, said by machines of this system."""
    site = case.busy()
    one, other = list(site.machines)[-2:]
    held = ManualState(one, 1, ManualMode.HELD, at_rest=True)
    found: dict[str, list[tuple[int, Message]]] = {
        "one-holder": a_second_apart(TokenHeld(node, TokenKind.TASK, 7, 3) for node in (one, other)),
        "let-go-again": [(SECOND, held), (2 * SECOND + FORGOTTEN_US, held)],
    }
    if mobile := [node for node, machine in site.machines.items() if machine.kind in MOBILE_KINDS]:
        found["hold-answered"] = unanswered(site, mobile[0])
    if case.parties is None:
        return found
    caller, near, far = case.parties
    task = Reference(caller, 9)
    kind = site.machines[near].kind
    call = CallForProposals(
        caller, CALL, task, Operation.TRANSPORT, kind, Criterion.FINISH_TIME, 0, 0, 60_000, 0, 0, NO_REFERENCE, 0,
        NO_REFERENCE, 0, 0, 0,
    )  # fmt: skip

    def bids(node: int, cost: int) -> list[Message]:
        return case.bidding(node, caller, CALL, task, cost)

    def to(node: int) -> Award:
        return Award(caller, CALL, node, task, 1, CallResult.AWARDED, Reason.NONE)

    found["calls-closed"] = a_second_apart([call, *bids(far, 900), *bids(near, 500), to(near), to(far)])
    found["bids-in-time"] = a_second_apart([call, *bids(near, 500), to(far)])
    found["bids-go-down"] = a_second_apart([call, *bids(near, 500), *bids(far, 900)])
    return found


def unanswered(site: Site, node: int) -> list[tuple[int, Message]]:
    """A machine that lives is ordered to stand, again and again, and goes on."""
    kind = site.machines[node].kind
    beat = Heartbeat(node, CONTRACT_VERSION, site.digest, 0, 1, kind, MachineState.WORKING)
    return a_second_apart([beat, ManualOrder(251, node, 1, ManualMode.HELD)] * MOST_WORDS)


def breaches() -> list[tuple[Case, str, list[tuple[int, Message]]]]:
    """Every log in which a rule is broken."""
    found = []
    for case in CASES.values():
        known = {rule.name for rule in rules_for(case.busy())}
        found += [(case, rule, log) for rule, log in common(case).items() if rule in known - set(case.shown_elsewhere)]
        found += [(case, rule, a_second_apart(log)) for rule, logs in case.broken.items() for log in logs]
    return found


@pytest.mark.parametrize(
    ("case", "rule", "log"),
    breaches(),
    ids=lambda value: value if isinstance(value, str) else getattr(value, "system", "log"),
)
def test_each_rule_finds_what_it_is_for(case: Case, rule: str, log: list[tuple[int, Message]]) -> None:
    verdict = judged(case.busy(), log)
    assert verdict.counts[rule] == 1, verdict.lines()


@every_system
def test_every_rule_of_a_system_is_shown_to_find_something(case: Case) -> None:
    shown = {rule for one, rule, _ in breaches() if one is case} | case.broken_in.keys() | case.shown_elsewhere
    rules = {rule.name for rule in rules_for(case.busy())}
    assert rules - shown == set()
    assert case.broken.keys() | case.broken_in.keys() <= rules


@every_system
def test_no_rule_finds_anything_where_nothing_is_wrong(case: Case) -> None:
    site = case.busy()
    messages = play(site, RunOptions(limit_s=case.limit_s)).messages
    verdict = judged(site, messages)
    assert verdict.is_good, verdict.lines()
    heard = {rule.name for rule in rules_for(site) if rule not in case.idle | BY_HAND and not rule.on_devices}
    assert {name for name in heard if not verdict.seen[name]} == set(), "else it is good because it judges nothing"
    for rule, breaks in case.broken_in.items():
        found = judged(site, breaks(messages))
        assert found.counts[rule] == 1, found.lines()


def test_kinds_are_those_of_the_machines() -> None:
    """Else the calls above would be nobody's business."""
    for case in CASES.values():
        if case.parties is not None:
            kinds = [case.busy().machines[node].kind for node in case.parties]
            assert kinds[1] is kinds[2] and kinds[0] is KindCode.DESK
