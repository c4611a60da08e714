"""Tasks as calls of the core: each stands until a robot has it aboard, and is open for bids in each round."""

from onboard.contract.codes import CallResult, Criterion, KindCode, Operation, Reason
from onboard.contract.mapd import StepRound
from onboard.contract.messages import Award, Bid, CallForProposals, Reference
from onboard.core.negotiation import RequestedTerms
from onboard.core.serial import to_bus_ms
from onboard.systems.mapd.tasks import TransportTask

#: Bits of a round in a bid, and of a step in an award (dbc/fleet.dbc: itinerary_version, task_version).
_ROUND, _STEP = 0xFF, 0x7F
#: So many tasks are called for in one round, oldest first: three frames each, a tenth of a second at 500 kbit/s.
CALLS_A_ROUND = 100
#: All calls that stand are said again, for whoever asks, at most once in so long for each of them, us: a fifth of the
#: bus at 500 kbit/s. Said for each who asks, those of a great floor filled the bus, and all missed something for ever.
CALL_AGAIN_US = 5_000
#: Rounds of one step that is opened again differ by this (dbc/mapd.dbc).
_ATTEMPT = 61


def terms_of(desk: int, task: TransportTask, step: int) -> RequestedTerms:
    """What the desk asks for in a round; stations are cells, and the award names the step."""
    name = Reference(desk, task.number)
    return RequestedTerms(
        name, Operation.TRANSPORT, KindCode.VEHICLE, Criterion.LENGTH, task.pickup, task.delivery, name, 0, step & _STEP
    )


def call_of(desk: int, task: TransportTask, until_us: int) -> CallForProposals:
    """The call that stands; its deadline is that of the round in which it is said."""
    terms = terms_of(desk, task, 0)
    return CallForProposals(
        desk,
        number_of(task.number),
        terms.task,
        terms.operation,
        terms.kind,
        terms.criterion,
        1,
        0,
        to_bus_ms(until_us),
        terms.from_station,
        terms.to_station,
        terms.load,
        terms.load_mm,
    )


def award_of(desk: int, step: int, robot: int, task: int) -> Award:
    """An award as it was said, after a restart of the desk."""
    name = Reference(desk, task)
    return Award(desk, number_of(task), robot, name, step & _STEP, CallResult.AWARDED, Reason.NONE)


def is_of_step(award: Award, step: int) -> bool:
    """Whether an award was made in the round of a step."""
    return award.result is CallResult.AWARDED and award.task_version == step & _STEP


def number_of(task: int) -> int:
    """The number of the call for a task; that of no call is 0."""
    return task + 1


def task_of(bid: Bid) -> int:
    """The task of a bid."""
    return bid.call - 1


def mark_of(opened: StepRound) -> int:
    """How bids name a round."""
    return opened.step + _ATTEMPT * opened.attempt & _ROUND
