"""What the machines of the system terminal say beyond the messages of all, on their device buses.

Written by ``make docs`` from ``dbc/terminal.dbc``: change that file, never this one.
"""

from onboard.contract.base import Message, message
from onboard.contract.codes import ManualMode
from onboard.contract.terminal import Action, HandlerMode, MoveMode, Verb


@message(frozen=True, slots=True)
class MoveOrder(Message):
    """Go on into the next slot.

    Repeated until MoveState names it, and each second until the slot is crossed; a drive never goes beyond the slot
    ordered, and one that crosses it and hears no order for DriveTimeOutMs stands, until it is said again.
    """

    #: A new number starts the order; a repeated one does nothing. 0 to 255.
    sequence: int
    #: Entity to be in. 1 to 255.
    entity: int
    #: Body slot there, 1 where a lane is entered; a vehicle's own bay in an area. 0 to 255.
    slot: int
    #: Entity to which it will be left, 0 for none: tells the way through. 0 to 255.
    towards: int


@message(frozen=True, slots=True)
class HandlerOrder(Message):
    """One action at a station; a new sequence starts it, a repeated one does nothing."""

    #: A new number starts the order. 0 to 255.
    sequence: int
    #: What is to be done; GOTO is none.
    action: Action
    #: Number of the box to be picked up. 0 to 65535.
    box: int


@message(frozen=True, slots=True)
class MissionAnswer(Message):
    """A mission that came whole: it is in the desk's journal, or is nothing that can be carried out."""

    #: Number of the mission. 0 to 255.
    mission: int
    #: Whether it will be carried out.
    is_taken: bool


@message(frozen=True, slots=True)
class MoveState(Message):
    """Where the body is.

    Said on change, and slowly otherwise.
    """

    #: Order carried out last. 0 to 255.
    sequence: int
    #: Entity of the body, 0: unknown. 0 to 255.
    entity: int
    #: Slot of the body. 0 to 255.
    slot: int
    #: What the drive does.
    mode: MoveMode
    #: Whether the slot is crossed: the next may be entered.
    at_end: bool


@message(frozen=True, slots=True)
class HandlerState(Message):
    """Docking gear and spreader.

    Said on change, and slowly otherwise.
    """

    #: Order carried out last. 0 to 255.
    sequence: int
    #: What they do: DOCKED holds the vehicle in the station.
    gear: HandlerMode
    #: Number on the label of the box aboard, 0 for none. 0 to 65535.
    box: int


@message(frozen=True, slots=True)
class LaneSensor(Message):
    """What a desk's cameras see of one lane.

    Said on change, and slowly otherwise.
    """

    #: Entity number of the lane. 1 to 255.
    lane: int
    #: Whether something lies there.
    blocked: bool


@message(frozen=True, slots=True)
class MissionKey(Message):
    """What an operator types: LOAD is one frame; TRANSHIP one for each box, and END.

    Said again every second until MissionAnswer names the mission; fewer boxes than END counts are inert.
    """

    #: Number of the mission: frames of one mission belong together. 0 to 255.
    mission: int
    #: What is ordered.
    verb: Verb
    #: LOAD: index of the type among the site's types in the order of its boxes; TRANSHIP: number of the box. 0 to
    #: 65535.
    what: int
    #: LOAD: how many boxes. END: how many were named. 0 to 31.
    count: int
    #: LOAD: area or station from which. 0 to 255.
    source: int
    #: Station to which. 0 to 255.
    target: int
    #: Date by which to put down, in s of bus time; 0: none. 0 to 32767 s.
    before_s: int
    #: Whether it goes before all that is not begun.
    urgent: bool


@message(frozen=True, slots=True)
class ManualKey(Message):
    """A person presses a key for a vehicle."""

    #: Grows by one with each press at this desk. 1 to 255.
    number: int
    #: Node-ID of the vehicle. 1 to 250.
    vehicle: int
    #: What the vehicle is to do.
    manual_mode: ManualMode
