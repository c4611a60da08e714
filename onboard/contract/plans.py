"""Plans, places, and where cars and machines are.

Written by ``make docs`` from ``dbc/fleet.dbc``: change that file, never this one.
"""

from typing import NamedTuple

from onboard.contract.base import Message, Reference, SetFrame, Stamp, message
from onboard.contract.codes import Grade, LegAction, Reason, Side, TaskPhase


@message(frozen=True, slots=True)
class ItineraryHead(SetFrame):
    """First frame of an itinerary.

    This and the legs 0 to legs-1 with one sender and version are one itinerary; an incomplete set is inert.
    TENTATIVE: goes with a bid. FIRM: replaces the sender's firm itinerary if its version is newer. RELEASED: has no
    legs and voids it.
    """

    #: Serial number (RFC 1982), never 0; starts anew with the boot counter. 0 to 255.
    version: int
    #: Strength of the reservations.
    grade: Grade
    #: Number of ItineraryLeg frames that follow. 0 to 31.
    legs: int
    #: ``award_ms``: Bus time of the award; the first leg begins here, and leg ends count from here. Lower stamps keep
    #: their windows. 0 to 4294967295 ms.
    #: ``initiator``: Node-ID whose call gave the stamp. 0 to 255.
    #: ``call``: Low byte of that call's number. 0 to 255.
    stamp: Stamp


@message(frozen=True, slots=True)
class ItineraryLeg(SetFrame):
    """One run of segments: begins where and when the leg before it ended.

    Windows of the single segments follow from the rest-to-rest motion profile of the site.
    """

    #: Version of the itinerary. 0 to 255.
    version: int
    #: What the machine does.
    action: LegAction
    #: Number of this leg, from 0. 0 to 30.
    leg: int
    #: Side of the station where the action is WORK.
    side: Side
    #: Alley 1 to 127 (its floor, where each floor has one), lift 128 to 191, spur 192 to 254. 1 to 254.
    track: int
    #: Segment in which the leg begins; on an alley 0 and length + 1 are the platforms of the lifts at its ends. 0 to
    #: 255.
    from_index: int
    #: Segment in which the leg ends; 0 and length + 1 as in from_index. 0 to 255.
    to_index: int
    #: End of the leg, counted from the itinerary's stamp_award_ms. 0 to 16777215 ms.
    end_ms: int


@message(frozen=True, slots=True)
class Progress(Message):
    """Where the body of a machine is.

    Sent where it stops, at the first border after that, before it gives back what it left, and else where the last
    word is 8 s old.
    """

    #: Firm itinerary under way; of a lift: bits 7 to 0 of the version of its gate's token, as it last moved. 0 to 255.
    itinerary_version: int
    #: Leg in hand; of a lift: bits 12 to 8 of that version. Its word holds for who holds the gate under it. 0 to 31.
    leg: int
    #: Track of the body. 1 to 254.
    track: int
    #: Segment that holds the body's centre; on an alley 0 and length + 1 are the platforms of the lifts at its ends. 0
    #: to 255.
    index: int
    #: Body's centre beyond the segment's centre, positive towards higher indices. -32768 to 32767 mm.
    offset_mm: int
    #: Speed, positive towards higher indices. -32768 to 32767 mm/s.
    speed_mm_s: int


@message(frozen=True, slots=True)
class Waiting(Message):
    """A machine waits for a segment; sent once for each wait."""

    #: Track of the segment. 1 to 254.
    track: int
    #: Index of the segment. 0 to 255.
    index: int
    #: Node-ID waited for, 0 for nobody. 0 to 255.
    blocker: int
    #: Why.
    reason: Reason


@message(frozen=True, slots=True)
class TaskReport(Message):
    """A task's present owner tells its phase."""

    #: ``origin``: Node-ID that named the task; 0 with number 0: none. 0 to 255.
    #: ``number``: Serial number of the task at its origin; 0 with origin 0: none. 0 to 65535.
    task: Reference
    #: Life of the task.
    phase: TaskPhase
    #: Where the load is or shall be: track << 8 | side << 7 | index; 65535 aboard the sender, 65534 outside. 0 to
    #: 65535.
    station: int
    #: Why, where the phase is REFUSED or FORFEITED.
    reason: Reason


@message(frozen=True, slots=True)
class CarAt(Message):
    """The custodian of a car states where it stands.

    A receiver keeps the statement of the newest version.
    """

    #: ``origin``: Node-ID that named the car; 0 with number 0: none. 0 to 255.
    #: ``number``: Serial number of the car at its origin; 0 with origin 0: none. 0 to 65535.
    car: Reference
    #: track << 8 | side << 7 | index; 65535 aboard the sender, 65534 has left the park. 0 to 65535.
    station: int
    #: Version of the car's token under which this is said. 0 to 65535.
    version: int
    #: Distance of the car's axles, rounded down to 10 mm: who fetches the car sets its shuttle to it. 1500 to 4050 mm.
    wheelbase_mm: int


@message(frozen=True, slots=True)
class Blocked(Message):
    """A segment cannot be passed: a person or a sensor says so.

    Plans that lead through it are made anew by their owners, all others stay. It stays so until Clear; the steward
    of the track says it again for whoever asks all, and no other machine says it.
    """

    #: Track of the segment. 1 to 254.
    track: int
    #: Index of the segment. 0 to 255.
    index: int
    #: Why.
    reason: Reason


@message(frozen=True, slots=True)
class Clear(Message):
    """A blocked segment can be passed again: an operator, or the steward of the track, says so."""

    #: Track of the segment. 1 to 254.
    track: int
    #: Index of the segment. 0 to 255.
    index: int
    #: Why.
    reason: Reason


class Leg(NamedTuple):
    """One run of segments: begins where and when the leg before it ended.

    Windows of the single segments follow from the rest-to-rest motion profile of the site.
    """

    #: What the machine does.
    action: LegAction
    #: Alley 1 to 127 (its floor, where each floor has one), lift 128 to 191, spur 192 to 254. 1 to 254.
    track: int
    #: Segment in which the leg begins; on an alley 0 and length + 1 are the platforms of the lifts at its ends. 0 to
    #: 255.
    from_index: int
    #: Segment in which the leg ends; 0 and length + 1 as in from_index. 0 to 255.
    to_index: int
    #: Side of the station where the action is WORK.
    side: Side
    #: End of the leg, counted from the itinerary's stamp_award_ms. 0 to 16777215 ms.
    end_ms: int


@message(frozen=True, slots=True)
class Itinerary(Message):
    """A machine's plan under version.

    Grade RELEASED has no legs and voids the version named. After its last leg a machine stands where it ends.
    """

    #: Serial number (RFC 1982), never 0; starts anew with the boot counter. 0 to 255.
    version: int
    #: Strength of the reservations.
    grade: Grade
    #: ``award_ms``: Bus time of the award; the first leg begins here, and leg ends count from here. Lower stamps keep
    #: their windows. 0 to 4294967295 ms.
    #: ``initiator``: Node-ID whose call gave the stamp. 0 to 255.
    #: ``call``: Low byte of that call's number. 0 to 255.
    stamp: Stamp
    #: Number of ItineraryLeg frames that follow. 0 to 31.
    legs: tuple[Leg, ...]
