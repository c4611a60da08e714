"""Everything that machines say: one frozen dataclass per message.

Field names are the signal names of ``dbc/fleet.dbc`` and ``dbc/device.dbc``, where the bits, ranges and cycle times
are; ``sender`` is the node-ID in the lowest byte of the identifier. A class with ``parts`` travels as a set of frames
(first class of the set first); all others are one frame. Times on the wire are bus time in milliseconds modulo
2**32; distances are whole millimetres.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from onboard.core.codes import (
    CallResult,
    Criterion,
    DeskInput,
    DeskText,
    DoorAction,
    DoorName,
    DoorPosition,
    DriveMode,
    Grade,
    KindCode,
    LegAction,
    LightColour,
    MachineState,
    ManualMode,
    Operation,
    OperatorAction,
    Reason,
    ShuttleAction,
    ShuttleMode,
    Side,
    TaskPhase,
    TokenKind,
)
from onboard.core.serial import ms_after


class Reference(NamedTuple):
    """A task or a car: the node that named it and its 16-bit number there (serial arithmetic, RFC 1982)."""

    origin: int
    number: int


#: No task, no car, no call.
NO_REFERENCE = Reference(0, 0)


@dataclass(frozen=True, slots=True)
class Message:
    """Base of all messages; ``sender`` is a node-ID."""

    sender: int


#: By class of message the kinds of machine that may say it; ``KindCode.OBSERVER`` stands for nodes 251 to 255.
Speakers = Mapping[type[Message], frozenset[KindCode]]


# --- fleet bus -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class EmergencyStop(Message):
    """Every machine stops at once and stays so until a person says otherwise."""

    reason: Reason


@dataclass(frozen=True, slots=True)
class TokenRequest(Message):
    """Asks whoever holds the token. ``predecessor`` is the node believed to pass before, 0 for nobody."""

    token_kind: TokenKind
    token: int
    version_seen: int
    itinerary_version: int
    predecessor: int


@dataclass(frozen=True, slots=True)
class TokenGrant(Message):
    """Moves one token to ``holder``. ``version`` is one more than the version under which the sender held it."""

    token_kind: TokenKind
    token: int
    version: int
    holder: int


@dataclass(frozen=True, slots=True)
class TokenRefusal(Message):
    """The holder's answer to a request that it cannot serve now."""

    token_kind: TokenKind
    token: int
    version: int
    requester: int
    reason: Reason


@dataclass(frozen=True, slots=True)
class TokenHeld(Message):
    """The holder's statement that it holds the token under ``version``: it ends the giver's re-sending."""

    token_kind: TokenKind
    token: int
    version: int


@dataclass(frozen=True, slots=True)
class BusTime(Message):
    """Bus time at the moment of sending, from the lowest live fixed node."""

    bus_time_us: int


@dataclass(frozen=True, slots=True)
class CallForProposals(Message):
    """A call: frames ``Call``, ``CallTerms``, ``CallLoad``, and for a sub-call (``depth`` not 0) ``CallParent``.

    ``call`` is the initiator's call number; a call opened again has a new one and ``attempt`` one more.
    ``from_station`` and ``to_station`` are station numbers or ``ANY_STATION``. ``wheelbase_mm`` is that of the car,
    0 where none is meant.

    A sub-call is ``part`` 1, 2, ... of the call ``parent`` (initiator, call). It can begin ``ready_ms`` after its own
    deadline (in steps of 100 ms); its winner holds the bid as an option for ``hold_ms`` after it (in steps of 250 ms),
    or is awarded at once where that is 0.
    """

    call: int
    task: Reference
    operation: Operation
    kind: KindCode
    criterion: Criterion
    attempt: int
    depth: int
    deadline_ms: int
    from_station: int
    to_station: int
    car: Reference
    wheelbase_mm: int
    parent: Reference = NO_REFERENCE
    part: int = 0
    ready_ms: int = 0
    hold_ms: int = 0


@dataclass(frozen=True, slots=True)
class Bid(Message):
    """``cost`` in the unit of the call's criterion: bus time in ms, cents, or mm. Lower is better, then lower node-ID.

    ``itinerary_version`` names the tentative itinerary that goes with it, sent right after; 0 for none.
    """

    initiator: int
    call: int
    cost: int
    itinerary_version: int


@dataclass(frozen=True, slots=True)
class Award(Message):
    """Closes one call. Idempotent; repeated until the winner's firm itinerary is heard. ``winner`` 0 for nobody."""

    call: int
    winner: int
    task: Reference
    task_version: int
    result: CallResult
    reason: Reason


@dataclass(frozen=True, slots=True)
class LeftOut(Message):
    """Nodes, 0 for nobody, whose bids for the sender's ``call`` do not count. Sent right before the call."""

    call: int
    node_a: int
    node_b: int
    node_c: int
    node_d: int
    node_e: int
    node_f: int


class Leg(NamedTuple):
    """One run of segments ``from_index`` to ``to_index`` on ``track``, ending at ``end_ms`` bus time.

    It begins where and when the leg before it ended; the first begins at the stamp's ``award_ms`` and ends at most
    2**24 ms after it. WORK and STAND have equal indices; WORK names the ``side`` of the station.
    """

    action: LegAction
    track: int
    from_index: int
    to_index: int
    side: Side
    end_ms: int


class Stamp(NamedTuple):
    """Rank of a firm itinerary: lower keeps its windows. Order: award (bus ms), initiator, low byte of the call."""

    award_ms: int
    initiator: int
    call: int

    def ranks_before(self, other: "Stamp") -> bool:
        """Whether this plan keeps its windows before the other's; of two stamps that differ always exactly one does."""
        after_ms = ms_after(self.award_ms, other.award_ms)
        if after_ms == ms_after(other.award_ms, self.award_ms):
            # The same time, or half the way round, where nobody can say which came first.
            return self < other
        return after_ms < 0


@dataclass(frozen=True, slots=True)
class Itinerary(Message):
    """A machine's plan under ``version`` (8-bit serial): frames ``ItineraryHead`` and one ``ItineraryLeg`` per leg.

    Grade RELEASED has no legs and voids the version named. After its last leg a machine stands where it ends.
    """

    version: int
    grade: Grade
    stamp: Stamp
    legs: tuple[Leg, ...]


@dataclass(frozen=True, slots=True)
class Progress(Message):
    """Where a machine's body is: sent when it enters a segment, starts, stops, and slowly otherwise."""

    itinerary_version: int
    leg: int
    track: int
    index: int
    offset_mm: int
    speed_mm_s: int


@dataclass(frozen=True, slots=True)
class Waiting(Message):
    """A machine waits for segment (``track``, ``index``), for node ``blocker`` (0: nobody), and why."""

    track: int
    index: int
    blocker: int
    reason: Reason


@dataclass(frozen=True, slots=True)
class TaskReport(Message):
    """A task's owner tells its phase; ``station`` is where the car is now or shall go."""

    task: Reference
    phase: TaskPhase
    station: int
    reason: Reason


@dataclass(frozen=True, slots=True)
class CarAt(Message):
    """The custodian of ``car`` states the station at which it stands, under the car token's ``version``.

    ``ANY_STATION`` means: aboard the sender; ``OUTSIDE``: it has left. ``wheelbase_mm`` is the car's.
    """

    car: Reference
    station: int
    version: int
    wheelbase_mm: int


@dataclass(frozen=True, slots=True)
class SyncRequest(Message):
    """Asks node ``whom`` (0: all) to state again what it vouches for: itinerary, place, cars, tokens it holds.

    ``boot_before`` is the boot counter that the sender knew of it before its present one, 0 for none.
    """

    whom: int
    boot_before: int = 0


@dataclass(frozen=True, slots=True)
class OperatorOrder(Message):
    """A person presses a key for node ``compartment`` from afar (row P52)."""

    compartment: int
    action: OperatorAction
    car: Reference


@dataclass(frozen=True, slots=True)
class Blocked(Message):
    """Segment (``track``, ``index``) cannot be passed: a person or a sensor says so. Plans go around it until Clear."""

    track: int
    index: int
    reason: Reason


@dataclass(frozen=True, slots=True)
class Clear(Message):
    """A blocked segment can be passed again."""

    track: int
    index: int
    reason: Reason


@dataclass(frozen=True, slots=True)
class ManualOrder(Message):
    """A person holds ``machine``, has it do one elementary action, or lets it go; said again until it answers."""

    machine: int
    number: int
    manual_mode: ManualMode


@dataclass(frozen=True, slots=True)
class ManualState(Message):
    """A machine's answer to the order of this ``number``; ``at_rest``: held, it stands and does nothing any more."""

    number: int
    manual_mode: ManualMode
    at_rest: bool


@dataclass(frozen=True, slots=True)
class Heartbeat(Message):
    """I live. ``mirror_digest`` is over the firm itineraries and cars known to the sender."""

    contract: int
    site_digest: int
    mirror_digest: int
    boot: int
    kind: KindCode
    state: MachineState
    epoch: int = 0


@dataclass(frozen=True, slots=True)
class Diagnostic(Message):
    """How often the sender dropped wire input for ``reason`` since its start, modulo 2**32."""

    reason: Reason
    count: int


# --- device bus ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class DriveOrder(Message):
    """Go to ``target_mm`` on the present track at most at ``speed_limit_mm_s``; to be repeated, see the DBC.

    A drive that hears no order for the DBC's time-out while it moves brakes to a stand. ``across`` means the spur at
    whose mouth the carrier is: its segment 1 is at 0 mm and the mouth one pitch before. A drive that is not that way
    turns first, and does so only where it stands in the mouth.
    """

    sequence: int
    target_mm: int
    speed_limit_mm_s: int
    across: bool = False


@dataclass(frozen=True, slots=True)
class DriveState(Message):
    """Position of the carrier's centre along its track and what the drive does; ``at_mark`` is the fine sensor.

    ``across`` tells that the carrier is turned towards a spur: its track is the spur, from the end of the turn into it
    to the end of the turn back.
    """

    sequence: int
    position_mm: int
    speed_mm_s: int
    mode: DriveMode
    at_mark: bool
    across: bool = False


@dataclass(frozen=True, slots=True)
class ShuttleOrder(Message):
    """One action of the shuttle; a new ``sequence`` starts it, a repeated one does nothing."""

    sequence: int
    action: ShuttleAction
    side: Side
    wheelbase_mm: int


@dataclass(frozen=True, slots=True)
class ShuttleState(Message):
    """The shuttle's mode for order ``sequence``; ``load_kg`` from its load cells; ``wheelbase_mm`` it is set to."""

    sequence: int
    mode: ShuttleMode
    extension_mm: int
    side: Side
    load_kg: int
    wheelbase_mm: int


@dataclass(frozen=True, slots=True)
class DoorOrder(Message):
    """Moves one door of a compartment; closing ends in LOCKED."""

    sequence: int
    door: DoorName
    action: DoorAction


@dataclass(frozen=True, slots=True)
class LightOrder(Message):
    """Sets the light before the input door."""

    colour: LightColour


@dataclass(frozen=True, slots=True)
class DeskOrder(Message):
    """What the desk shows; with TAKE_TICKET it prints the ticket of ``car``."""

    sequence: int
    text: DeskText
    car: Reference


@dataclass(frozen=True, slots=True)
class DoorState(Message):
    """Both doors and the light as sensed."""

    input_door: DoorPosition
    output_door: DoorPosition
    light: LightColour


@dataclass(frozen=True, slots=True)
class DeskEvent(Message):
    """A customer's act at the desk; ``car`` is that of the ticket, zeros for the key. ``sequence`` grows by one."""

    sequence: int
    event: DeskInput
    car: Reference


@dataclass(frozen=True, slots=True)
class BayState(Message):
    """What the bay's sensors see: a car's load, length, height and wheelbase, a person, a carrier at the output.

    Zeros for length, height and wheelbase where no car stands.
    """

    load_kg: int
    length_mm: int
    height_mm: int
    wheelbase_mm: int
    person_inside: bool
    carrier_in_front: bool


@dataclass(frozen=True, slots=True)
class PlatformState(Message):
    """What a lift's platform senses: a carrier wholly aboard at its mark, something over the sill, the weight."""

    carrier_aboard: bool
    crossing: bool
    load_kg: int
