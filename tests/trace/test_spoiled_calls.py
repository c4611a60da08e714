"""A call that is not seen closed: a fault, unless its closing word may have come to nothing between it and its seal."""

from dataclasses import replace

import pytest

from bus_sim.sites import find_site
from onboard.contract.codes import CONTRACT_VERSION, Criterion, KindCode, MachineState, Operation
from onboard.contract.messages import NO_REFERENCE, BusTime, CallForProposals, Heartbeat, Reference
from onboard.trace.check.checks import Checks

SECOND = 1_000_000
SITE = find_site("small")
CALLER = min(SITE.machines)


def findings(seals: str, attacked_until_s: int) -> list[str]:
    """What is found of a call with a deadline at 12 s, whose caller lives on and says nothing of it."""
    checks = Checks(replace(SITE, seals=seals))
    if attacked_until_s:
        checks.excuse(attacked_until_s * SECOND)
    kind = SITE.machines[CALLER].kind
    for at_s in range(8, 60, 2):
        beat = Heartbeat(CALLER, CONTRACT_VERSION, SITE.digest or 1, 0, 1, kind, MachineState.WORKING)
        checks.feed_message(at_s * SECOND, beat)
        checks.feed_message(at_s * SECOND, BusTime(CALLER, at_s * SECOND))
        if at_s == 10:
            checks.feed_message(at_s * SECOND, CALL)
    return [one.what for one in checks.finish().findings if one.rule == "calls-closed"]


CALL = CallForProposals(
    sender=CALLER,
    call=7,
    task=Reference(CALLER, 3),
    operation=Operation.PARK,
    kind=KindCode.ROBOT,
    criterion=Criterion.FINISH_TIME,
    attempt=1,
    depth=0,
    deadline_ms=12_000,
    from_station=0x0105,
    to_station=0xFFFF,
    car=NO_REFERENCE,
    wheelbase_mm=2_800,
)


@pytest.mark.parametrize(
    ("seals", "attacked_until_s", "is_found"),
    [
        ("required", 0, True),
        ("required", 11, True),
        ("required", 30, False),
        ("off", 30, True),
    ],
)
def test_a_call_that_is_never_closed(seals: str, attacked_until_s: int, is_found: bool) -> None:
    assert findings(seals, attacked_until_s) == (["call 7 was never closed"] if is_found else [])
