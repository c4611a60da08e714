"""What a machine says to its own drives, doors and sensors, and they to it.

Written by ``make docs`` from ``dbc/device.dbc``: change that file, never this one.
"""

from onboard.contract.base import Message, Reference, message
from onboard.contract.codes import (
    DeskInput,
    DeskText,
    DoorAction,
    DoorName,
    DoorPosition,
    DriveMode,
    LightColour,
    ShuttleAction,
    ShuttleMode,
    Side,
)


@message(frozen=True, slots=True)
class DriveOrder(Message):
    """Go to target_mm on the present track.

    Repeated every drive_refresh of the site while the drive moves; a moving drive that hears none for
    DriveTimeOutMs brakes to a stand by itself.
    """

    #: Grows by one with every new target; a repeat has the same. 0 to 255.
    sequence: int
    #: Wanted position of the carrier's centre along its track; 0 is segment 1, the mouth of a linked end is one pitch
    #: beyond it. On a site that is not straight each track begins elsewhere on the tape, so that the number tells the
    #: track. -2147483648 to 2147483647 mm.
    target_mm: int
    #: Highest speed for this move; 0 brakes to a stand. 0 to 65535 mm/s.
    speed_limit_mm_s: int
    #: 1: the track lies across the main direction of the site, as a spur does, 0: along it. A drive that is not turned
    #: that way turns first, standing in the mouth; elsewhere it refuses.
    across: bool = False


@message(frozen=True, slots=True)
class ShuttleOrder(Message):
    """One action of the shuttle.

    A new sequence starts it, a repeated one does nothing.
    """

    #: Grows by one with every new action. 0 to 255.
    sequence: int
    #: What to do.
    action: ShuttleAction
    #: To which side.
    side: Side
    #: Distance of the axles that the telescopic shuttle sets itself to. 0 to 8191 mm.
    wheelbase_mm: int


@message(frozen=True, slots=True)
class DoorOrder(Message):
    """Moves one door of a compartment; closing ends in LOCKED.

    The doors are interlocked in hardware: one opens only while the other is LOCKED.
    """

    #: Grows by one with every order. 0 to 255.
    sequence: int
    #: Which door.
    door: DoorName
    #: What to do.
    action: DoorAction


@message(frozen=True, slots=True)
class LightOrder(Message):
    """Sets the light before the input door."""

    #: Green: drive in. Red: the bay is taken.
    colour: LightColour


@message(frozen=True, slots=True)
class DeskOrder(Message):
    """What the desk shows; with TAKE_TICKET it prints the ticket of the car.

    Its number, and the code of both TicketPrint with this sequence. Without both it does nothing and waits for a
    repeat.
    """

    #: Grows by one with every order. 0 to 255.
    sequence: int
    #: What is shown.
    text: DeskText
    #: ``origin``: Node-ID that named the car; 0 with number 0: none. 0 to 255.
    #: ``number``: Serial number of the car at its origin; 0 with origin 0: none. 0 to 65535.
    car: Reference
    #: With GO_TO the node-ID of the compartment to which the car is brought, else 0. 0 to 250.
    compartment: int = 0


@message(frozen=True, slots=True)
class StateRequest(Message):
    """Asks all devices of this machine, of whatever system, how they stand.

    Each answers at once with its state words. Sent when a controller begins a life, and every second while it
    starts; a device that does not know it tells the same on change and at its slow repeats.
    """


@message(frozen=True, slots=True)
class TicketPrint(Message):
    """Half of the code of the ticket that the DeskOrder of this sequence prints.

    Whoever knows car and code gets the car: it is on this bus and on paper, and no log keeps it.
    """

    #: That of the DeskOrder. 0 to 255.
    sequence: int
    #: 0: the low 40 bits, 1: the high 40 bits. 0 to 1.
    half: int
    #: The half. 0 to 1099511627775.
    code: int


@message(frozen=True, slots=True)
class DriveState(Message):
    """Position and state of the drive.

    Sent when its mode changes, when the carrier passes the border or the middle of a segment, on arrival, and every
    10 s at rest.
    """

    #: Sequence of the last order taken up. 0 to 255.
    sequence: int
    #: Position of the carrier's centre along its track; in a mouth, turned towards a track, one pitch beyond its end.
    #: By the same tape as target_mm. -2147483648 to 2147483647 mm.
    position_mm: int
    #: Speed. -32768 to 32767 mm/s.
    speed_mm_s: int
    #: What the drive does.
    mode: DriveMode
    #: 1: the fine sensor sees a segment's mark, the carrier is within 5 mm of its centre.
    at_mark: bool
    #: 1: turned across the main direction of the site, as in a spur, which then is the track; it changes at the end of
    #: a turn.
    across: bool = False


@message(frozen=True, slots=True)
class ShuttleState(Message):
    """The shuttle: sent when its mode or load changes, and every 10 s at rest."""

    #: Sequence of the last order taken up. 0 to 255.
    sequence: int
    #: Where it is and what it does. REACHED again after GRIPPING or RELEASING.
    mode: ShuttleMode
    #: How far it is out. 0 to 8191 mm.
    extension_mm: int
    #: To which side it is out.
    side: Side
    #: Sum of its load cells. 0 to 4095 kg.
    load_kg: int
    #: Distance of axles that it is set to. 0 to 8191 mm.
    wheelbase_mm: int


@message(frozen=True, slots=True)
class DoorState(Message):
    """Both doors and the light as sensed: sent on change and every 10 s."""

    #: Door towards the street.
    input_door: DoorPosition
    #: Door towards the alley.
    output_door: DoorPosition
    #: Light before the input door.
    light: LightColour


@message(frozen=True, slots=True)
class DeskEvent(Message):
    """A customer's act at the desk; sent three times 50 ms apart, as one lost frame must not lose a customer.

    TICKET and CANCEL come with the two TicketRead of what was read, each time.
    """

    #: Grows by one with every act; repeats have the same. 0 to 255.
    sequence: int
    #: What the customer did.
    event: DeskInput
    #: ``origin``: Node-ID that named the car; 0 with number 0: none. 0 to 255.
    #: ``number``: Serial number of the car at its origin; 0 with origin 0: none. 0 to 65535.
    car: Reference


@message(frozen=True, slots=True)
class BayState(Message):
    """What the bay's sensors see: sent on change and every 10 s."""

    #: Weight on the bay, 0 where it is empty. 0 to 4095 kg.
    load_kg: int
    #: Length of the car, 0 where there is none. 0 to 8191 mm.
    length_mm: int
    #: Height of the car, 0 where there is none. 0 to 4095 mm.
    height_mm: int
    #: Distance of its axles, 0 where there is none. 0 to 8191 mm.
    wheelbase_mm: int
    #: 1: the light curtain sees a person, or a car not fully in.
    person_inside: bool
    #: 1: a carrier stands before the output door.
    carrier_in_front: bool
    #: Width of the car without its mirrors, 0 where there is none, or where the site limits none and nothing measures
    #: it. 0 to 4095 mm.
    width_mm: int


@message(frozen=True, slots=True)
class PlatformState(Message):
    """What a lift's platform senses: sent on change and every 10 s."""

    #: 1: a carrier stands wholly on the platform, at its mark.
    carrier_aboard: bool
    #: 1: something is over the sill; the drive refuses to move.
    crossing: bool
    #: Weight on the platform beyond the empty carrier. 0 to 4095 kg.
    load_kg: int


@message(frozen=True, slots=True)
class TicketRead(Message):
    """Half of the code of the ticket of a DeskEvent; no log keeps it."""

    #: That of the DeskEvent. 0 to 255.
    sequence: int
    #: 0: the low 40 bits, 1: the high 40 bits. 0 to 1.
    half: int
    #: The half, as it was read. 0 to 1099511627775.
    code: int


@message(frozen=True, slots=True)
class BatteryState(Message):
    """The battery's gauge: sent when charging begins or ends, when it is empty or full, and every 30 s."""

    #: What is left of its capacity; 0: it is empty, and no drive moves. Less than a thousandth is told as 1. 0 to 1000.
    charge_permille: int
    #: 1: current flows in from a charger.
    charging: bool
