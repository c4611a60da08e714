"""Who lives, who stands and why, and what people order.

Written by ``make docs`` from ``dbc/fleet.dbc``: change that file, never this one.
"""

from onboard.contract.base import Message, Reference, message
from onboard.contract.codes import KindCode, MachineState, ManualMode, OperatorAction, Reason


@message(frozen=True, slots=True)
class EmergencyStop(Message):
    """Every machine stops at once and stays so until Go, or until 30 s after it was last heard.

    This bus is not a certified safety channel: an independent emergency-stop circuit remains.
    """

    #: Why.
    reason: Reason


@message(frozen=True, slots=True)
class Go(Message):
    """Lifts emergency stops: who was stopped by stopper goes on.

    Only an operator's node, 251 to 255, says it. A stop that is lifted by nobody ends 30 s after it was last heard.
    """

    #: Node-ID whose stop is lifted, 0 for all. 0 to 255.
    stopper: int


@message(frozen=True, slots=True)
class BusTime(Message):
    """Bus time at the moment of sending, from the lowest live fixed node.

    Receivers slew; one that is far off for two messages in a row is an obstacle, sets its clock, and takes part
    again.
    """

    #: Bus time modulo 65 * 2^32 ms (8.8 years). Every *_ms on this bus is this time in ms modulo 2^32, rounded up. 0 to
    #: 281474976710655 us.
    bus_time_us: int


@message(frozen=True, slots=True)
class ManualOrder(Message):
    """A person, or whoever orders for one, holds a machine that moves, or lets it go (row M38).

    Repeated every second until ManualState has its number. It permits nothing: every step needs its rights as ever,
    and what must not be left half done, such as a ride, is ended first.
    """

    #: Node-ID of the machine. 1 to 250.
    machine: int
    #: Serial number of the order, the same in its repeats. 1 to 255.
    number: int
    #: HELD: begin nothing more, ask for no more rights and bid for nothing; STEP: carry out the next elementary action
    #: of the plan, then stay held (vehicles of a terminal; others stay as they are); AUTOMATIC: go on.
    manual_mode: ManualMode


@message(frozen=True, slots=True)
class ManualState(Message):
    """A machine tells whether it is held.

    In answer to an order, when it has come to rest, and to whoever asks while it is held.
    """

    #: Number of the last order, 0 for none. 0 to 255.
    number: int
    #: What it does now; HELD is in its journal and outlives a restart.
    manual_mode: ManualMode
    #: Held, it stands and does nothing any more; its rights and its load stay its own.
    at_rest: bool


@message(frozen=True, slots=True)
class Halted(Message):
    """A machine does nothing any more and says why, once for each heartbeat period.

    Or, by whoever still lives, of a machine that fell silent.
    """

    #: Node-ID of the machine that stands: the sender's own, or that of a machine that is silent. 1 to 250.
    machine: int
    #: Why it stands.
    reason: Reason
    #: Node-ID that brought it about, 0 for nobody. 0 to 255.
    cause: int
    #: Whether only a person can let it go on.
    needs_person: bool
    #: Boot counter of the machine that stands, as the sender knows it, 0 for unknown. 0 to 255.
    boot: int


@message(frozen=True, slots=True)
class SyncRequest(Message):
    """Asks a node to say again what it vouches for.

    Its firm itinerary as told under its version, where it is, the cars in its custody, the tokens it holds.
    """

    #: Node-ID asked, 0 for all. 0 to 255.
    whom: int
    #: Boot counter that the sender knew of that node before its present one, 0 for none. A node that has no journal of
    #: that life, or an older one, falls silent until a person regenerates its tokens. 0 to 255.
    boot_before: int = 0


@message(frozen=True, slots=True)
class OperatorOrder(Message):
    """A person presses a key of a compartment's desk from afar; the same path as a customer's press."""

    #: Node-ID of the compartment. 1 to 255.
    compartment: int
    #: Which key. URGENT_TICKET: a ticket that is served before all that wait at this desk, once the task in hand is
    #: over. CHARGING_KEY: the key of who asks for a place to charge.
    action: OperatorAction
    #: ``origin``: Node-ID that named the car; 0 with number 0: none. 0 to 255.
    #: ``number``: Serial number of the car at its origin; 0 with origin 0: none. 0 to 65535.
    car: Reference


@message(frozen=True, slots=True)
class SyncDone(Message):
    """All that the sender vouches for has been said since the SyncRequest that it answers.

    Whoever was started again uses no right before those who live have said this.
    """

    #: Node-ID that asked, 0 for all. 0 to 255.
    whom: int
    #: Boot counter of the sender. 0 to 255.
    boot: int
    #: Where whom is 0, a bit for each machine that this answers, by its place among the node-IDs of the site, from 0,
    #: modulo 48; 0: not told. 0 to 281474976710655.
    askers: int


@message(frozen=True, slots=True)
class Heartbeat(Message):
    """I live.

    A machine with another contract or site joins as an obstacle and never bids. After three missing ones a node
    counts as silent.
    """

    #: While contract 2 is open: 128 plus the low 7 bits of the CRC-32 of the lines BO_ and SG_ of this file, so that
    #: builds of different days are strangers. 0 to 255.
    contract: int
    #: Digest of the site's meaning; never 0. 1 to 65535.
    site_digest: int
    #: CRC-16/CCITT-FALSE over the sender's firm itineraries (node << 8 | version, by node), cars (origin << 16 |
    #: number, station, by car) and blocked segments (1 << 31 | track << 8 | index), as 32-bit big-endian words. 0 to
    #: 65535.
    mirror_digest: int
    #: Boot counter; another value means that the sender was restarted. 1 to 255.
    boot: int
    #: Kind of the machine.
    kind: KindCode
    #: What it does.
    state: MachineState
    #: Epoch of the site: grows by one each time tokens are regenerated. A machine of another epoch is an obstacle. 0 to
    #: 255.
    epoch: int = 0


@message(frozen=True, slots=True)
class Diagnostic(Message):
    """How often the sender dropped wire input for one reason since its start.

    Sent when a count has grown, at most once in a heartbeat period for each reason.
    """

    #: Why it was dropped.
    reason: Reason
    #: Times, modulo 2^32. 0 to 4294967295.
    count: int
