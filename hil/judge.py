"""After each test: error counters are read and judged, and so are the plant, the fleet and everything that was said."""

from collections.abc import Iterator
from dataclasses import dataclass

from hil.scenarios.scenario import BenchScenario
from hil.stage import TestBench
from onboard.contract.codes import Reason
from onboard.contract.messages import Diagnostic
from onboard.ports.bus import BusHealth, ErrorState
from onboard.trace.check.checks import Checks, LogVerdict

#: Calls that a device did not heed because bus time reached it a tenth of a second late: a busy host does that to a
#: process and to a bridge. It is told in the report; the call is opened again.
OF_THE_HOST = frozenset({Reason.BUS_TIME_LOST})


@dataclass(frozen=True)
class Judgement:
    """``faults`` are lines for a person, none where all is well; ``counters`` None where the bench cannot read them."""

    faults: tuple[str, ...]
    counters: BusHealth | None
    drops: dict[Reason, int]


def judge(stage: TestBench, scenario: BenchScenario, counters: BusHealth | None) -> Judgement:
    """Look at all that a run has left behind."""
    diagnostics = stage.own(Diagnostic)
    drops = {one.message.reason: one.message.count for one in diagnostics}
    faults = [
        *_of_counters(counters, scenario),
        *(
            f"it dropped input: {reason.name} {count} times"
            for reason, count in drops.items()
            if reason not in scenario.drops | OF_THE_HOST
        ),
        *(f"plant: {violation}" for violation in stage.world.violations()),
        *_of_fleet(stage),
    ]
    verdict = _verdict(stage, scenario)
    if not verdict.is_good:
        faults += verdict.lines(
            lambda node: stage.site.machines[node].name if node in stage.site.machines else str(node)
        )
    return Judgement(tuple(faults), counters, drops)


def _of_counters(counters: BusHealth | None, scenario: BenchScenario) -> Iterator[str]:
    if counters is None:
        return
    if counters.state is not ErrorState.ERROR_ACTIVE:
        yield f"counters: it is {counters.state.name.lower().replace('_', '-')} at the end"
    if not scenario.wire_errors and (counters.tec or counters.rec):
        yield f"counters: TEC {counters.tec}, REC {counters.rec} on a bus without errors"
    if counters.receive_overflows:
        yield f"counters: {counters.receive_overflows} frames lost for want of room"
    if counters.send_refused and not scenario.late:
        yield f"counters: {counters.send_refused} frames refused for want of room"


def _of_fleet(stage: TestBench) -> Iterator[str]:
    for controller in stage.simulation.controllers.values():
        if controller.holon.halted is not None:
            yield f"{controller.holon.machine.name} of the simulated fleet halted: {controller.holon.halted}"


def _verdict(stage: TestBench, scenario: BenchScenario) -> LogVerdict:
    checks = Checks(stage.site, disturbed=scenario.is_disturbed)
    for one in stage.said:
        checks.feed_message(one.time_us, one.message, one.bus)
    return checks.finish()
