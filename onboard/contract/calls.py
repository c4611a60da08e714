"""Calls, bids and awards.

Written by ``make docs`` from ``dbc/fleet.dbc``: change that file, never this one.
"""

from onboard.contract.base import NO_REFERENCE, Message, Reference, SetFrame, message
from onboard.contract.codes import CallResult, Criterion, KindCode, Operation, Reason


@message(frozen=True, slots=True)
class LeftOut(Message):
    """Bids of these nodes for the sender's call do not count: they forfeited its task, or stand in the way.

    Sent right before the call; a node that did not hear it may lose to such a bid until the call is opened again.
    """

    #: Number of the call that follows. 0 to 65535.
    call: int
    #: Node-ID left out, 0 for nobody. 0 to 255.
    node_a: int
    #: Node-ID left out, 0 for nobody. 0 to 255.
    node_b: int
    #: Node-ID left out, 0 for nobody. 0 to 255.
    node_c: int
    #: Node-ID left out, 0 for nobody. 0 to 255.
    node_d: int
    #: Node-ID left out, 0 for nobody. 0 to 255.
    node_e: int
    #: Node-ID left out, 0 for nobody. 0 to 255.
    node_f: int


@message(frozen=True, slots=True)
class Call(SetFrame):
    """First frame of a call for proposals.

    The set Call, CallTerms, CallLoad and, where depth or ready_ms is not 0, CallParent with one sender and call
    number is one call; an incomplete set is inert. A call of its own tells CallParent before CallLoad, and is whole
    without it.
    """

    #: The initiator's call number (serial, RFC 1982; never 0). All frames of one call carry it. 0 to 65535.
    call: int
    #: ``origin``: Node-ID that named the task; 0 with number 0: none. 0 to 255.
    #: ``number``: Serial number of the task at its origin; 0 with origin 0: none. 0 to 65535.
    task: Reference
    #: What is asked for.
    operation: Operation
    #: Kind of machine that is called; all others spend nothing on it.
    kind: KindCode
    #: Meaning and unit of the cost in the bids for this call.
    criterion: Criterion
    #: 1 for the first call for this task; one more each time it is opened again, under a new call number. 1 to 15.
    attempt: int
    #: 0 for a call of its own, one more for each level of sub-call. 0 to 15.
    depth: int
    #: Number of a sub-call among those of its parent, from 1; 0 for a call of its own. 0 to 15.
    part: int = 0


@message(frozen=True, slots=True)
class CallTerms(SetFrame):
    """Second frame of a call."""

    #: The initiator's call number (serial, RFC 1982; never 0). All frames of one call carry it. 0 to 65535.
    call: int
    #: Bus time after which no bid counts. The initiator counts a bid received up to its guard before this, by its own
    #: bus time. 0 to 4294967295 ms.
    deadline_ms: int
    #: Station at which the load is: track << 8 | side << 7 | index; 65535: the bidder chooses; 65281 to 65295: it
    #: chooses a place for a car of class 1 to 15. 0 to 65535.
    from_station: int


@message(frozen=True, slots=True)
class CallLoad(SetFrame):
    """Third frame of a call."""

    #: The initiator's call number (serial, RFC 1982; never 0). All frames of one call carry it. 0 to 65535.
    call: int
    #: Station to which the load shall go: track << 8 | side << 7 | index; 65535: the bidder chooses. 0 to 65535.
    to_station: int
    #: ``origin``: Node-ID that named the car; 0 with number 0: none. 0 to 255.
    #: ``number``: Serial number of the car at its origin; 0 with origin 0: none. 0 to 65535.
    car: Reference
    #: Distance of the car's axles, in steps of 10 mm; 1500 where no car is meant. 1500 to 4050 mm.
    wheelbase_mm: int


@message(frozen=True, slots=True)
class CallParent(SetFrame):
    """Fourth frame of a sub-call (depth not 0): what it is a part of.

    Calls of their own do without it.
    """

    #: The initiator's call number (serial, RFC 1982; never 0). All frames of one call carry it. 0 to 65535.
    call: int
    #: ``origin``: Node-ID of the initiator of the call that this one is a part of; 0 with number 0: none. 0 to 255.
    #: ``number``: Call number of the call that this one is a part of; 0 with origin 0: none. 0 to 65535.
    parent: Reference = NO_REFERENCE
    #: How long after this call's deadline the part can begin at the earliest, in steps of 100 ms; of a call of its own:
    #: when the bay can give or take the car. 0 to 1638300 ms.
    ready_ms: int = 0
    #: How long after this call's deadline the winner holds its bid as an option, in steps of 250 ms; 0: no option, the
    #: award follows the deadline. 0 to 255750 ms.
    hold_ms: int = 0


@message(frozen=True, slots=True)
class Award(Message):
    """Closes one call; idempotent.

    Repeated until the winner's firm itinerary or a TaskReport of the winner is heard. A machine acts on a task only
    after this frame.
    """

    #: The initiator's call number (serial, RFC 1982; never 0). All frames of one call carry it. 0 to 65535.
    call: int
    #: Node-ID that does the task, 0 for nobody. 0 to 255.
    winner: int
    #: ``origin``: Node-ID that named the task; 0 with number 0: none. 0 to 255.
    #: ``number``: Serial number of the task at its origin; 0 with origin 0: none. 0 to 65535.
    task: Reference
    #: Version of the right to this task (serial number, RFC 1982); raised only by its custodian. 0 to 127.
    task_version: int
    #: How the call ended; OPTION: not yet, the winner holds its bid until AWARDED, WITHDRAWN or the end of hold_ms.
    result: CallResult
    #: Why, where nobody won.
    reason: Reason


@message(frozen=True, slots=True)
class Bid(Message):
    """A bid better than every bid heard so far for the call.

    The bids of one call strictly decrease on the bus (equal cost: lower node-ID). Who cannot do better never
    answers.
    """

    #: Node-ID whose call this answers. 1 to 255.
    initiator: int
    #: The initiator's call number (serial, RFC 1982; never 0). All frames of one call carry it. 0 to 65535.
    call: int
    #: In the unit of the call's criterion: FINISH_TIME bus time in ms modulo 2^32, MONEY in cents, LENGTH in mm. Lower
    #: is better. 0 to 4294967295.
    cost: int
    #: Version of the tentative itinerary that the sender sends right after; 0 for none. 0 to 255.
    itinerary_version: int


@message(frozen=True, slots=True)
class CallForProposals(Message):
    """A call for proposals.

    A call opened again has a new number and attempt one more. A sub-call is part 1, 2, ... of the call parent
    (initiator, call): it can begin ready_ms after its own deadline, and its winner holds the bid as an option for
    hold_ms after it, or is awarded at once where that is 0. wheelbase_mm is 0 where no car is meant.
    """

    #: The initiator's call number (serial, RFC 1982; never 0). All frames of one call carry it. 0 to 65535.
    call: int
    #: ``origin``: Node-ID that named the task; 0 with number 0: none. 0 to 255.
    #: ``number``: Serial number of the task at its origin; 0 with origin 0: none. 0 to 65535.
    task: Reference
    #: What is asked for.
    operation: Operation
    #: Kind of machine that is called; all others spend nothing on it.
    kind: KindCode
    #: Meaning and unit of the cost in the bids for this call.
    criterion: Criterion
    #: 1 for the first call for this task; one more each time it is opened again, under a new call number. 1 to 15.
    attempt: int
    #: 0 for a call of its own, one more for each level of sub-call. 0 to 15.
    depth: int
    #: Bus time after which no bid counts. The initiator counts a bid received up to its guard before this, by its own
    #: bus time. 0 to 4294967295 ms.
    deadline_ms: int
    #: Station at which the load is: track << 8 | side << 7 | index; 65535: the bidder chooses; 65281 to 65295: it
    #: chooses a place for a car of class 1 to 15. 0 to 65535.
    from_station: int
    #: Station to which the load shall go: track << 8 | side << 7 | index; 65535: the bidder chooses. 0 to 65535.
    to_station: int
    #: ``origin``: Node-ID that named the car; 0 with number 0: none. 0 to 255.
    #: ``number``: Serial number of the car at its origin; 0 with origin 0: none. 0 to 65535.
    car: Reference
    #: Distance of the car's axles, in steps of 10 mm; 1500 where no car is meant. 1500 to 4050 mm.
    wheelbase_mm: int
    #: ``origin``: Node-ID of the initiator of the call that this one is a part of; 0 with number 0: none. 0 to 255.
    #: ``number``: Call number of the call that this one is a part of; 0 with origin 0: none. 0 to 65535.
    parent: Reference = NO_REFERENCE
    #: Number of a sub-call among those of its parent, from 1; 0 for a call of its own. 0 to 15.
    part: int = 0
    #: How long after this call's deadline the part can begin at the earliest, in steps of 100 ms; of a call of its own:
    #: when the bay can give or take the car. 0 to 1638300 ms.
    ready_ms: int = 0
    #: How long after this call's deadline the winner holds its bid as an option, in steps of 250 ms; 0: no option, the
    #: award follows the deadline. 0 to 255750 ms.
    hold_ms: int = 0
