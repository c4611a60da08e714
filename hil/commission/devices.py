"""The steps on the device bus: sensors one by one, actuators one by one, the stop chain; a table for each kind."""

from collections.abc import Awaitable, Callable

from hil.commission.drive import ARRIVED_MM, Moved, move
from hil.commission.person import is_yes
from hil.commission.setting import REPEAT_S, CommissionSetting
from onboard.contract.codes import (
    DeskInput,
    DeskText,
    DoorAction,
    DoorName,
    DoorPosition,
    KindCode,
    LightColour,
    ShuttleAction,
    ShuttleMode,
    Side,
)
from onboard.contract.messages import (
    NO_REFERENCE,
    BayState,
    DeskEvent,
    DeskOrder,
    DoorOrder,
    DoorState,
    DriveState,
    LightOrder,
    Message,
    PlatformState,
    ShuttleOrder,
    ShuttleState,
)
from onboard.core.serial import successor
from onboard.work.timing import DeviceTiming

#: Small and slow: a hand's breadth, at a pace that one can step away from.
STEP_MM, SPEED_MM_S = 200, 100
#: For the emergency stop there must be time to press it.
STOP_SPEED_MM_S = 20
#: A person needs this long to find and press a key, s.
PRESS_S = 60.0

Step = Callable[[CommissionSetting], Awaitable[bool]]


# --- sensors -------------------------------------------------------------------------------------------------------


def _senses(kind: type[Message], name: str, in_words: Callable[[Message], str]) -> Step:
    """A step that waits for a state and asks whether it is true."""

    async def step(setting: CommissionSetting) -> bool:
        state = await setting.devices.first(kind, REPEAT_S, setting.is_own)
        if state is None:
            return setting.note(name, f"it has not said anything within {REPEAT_S:g} s", passed=False)
        what = in_words(state)
        true = await is_yes(setting.person, f"The {name} says: {what}. Is that so?")
        return setting.note(name, f"{what}: {'confirmed' if true else 'not so'}", passed=true)

    return step


def _drive_told(state: Message) -> str:
    assert isinstance(state, DriveState)
    mark = "at a mark" if state.at_mark else "at no mark"
    return f"{state.position_mm} mm along the track, {state.mode.name.lower()}, {mark}"


def _shuttle_told(state: Message) -> str:
    assert isinstance(state, ShuttleState)
    return f"{state.mode.name.lower()}, {state.extension_mm} mm out, {state.load_kg} kg aboard"


def _platform_told(state: Message) -> str:
    assert isinstance(state, PlatformState)
    aboard = "a carrier aboard" if state.carrier_aboard else "no carrier aboard"
    return f"{aboard}, {state.load_kg} kg, sill {'broken' if state.crossing else 'free'}"


def _doors_told(state: Message) -> str:
    assert isinstance(state, DoorState)
    return (
        f"input door {state.input_door.name.lower()}, output door {state.output_door.name.lower()}, "
        f"light {state.light.name.lower()}"
    )


def _bay_told(state: Message) -> str:
    assert isinstance(state, BayState)
    person = "a person inside" if state.person_inside else "nobody inside"
    return f"{state.load_kg} kg in the bay, {state.length_mm} mm long, {person}"


async def desk_key(setting: CommissionSetting) -> bool:
    """The key of the desk arrives."""
    setting.person.tell("Press the key at the desk now.")
    since = setting.devices.mark()
    pressed = await setting.devices.first(
        DeskEvent, PRESS_S, lambda one: setting.is_own(one) and one.event is DeskInput.KEY, since
    )
    return setting.note(
        "desk key", "heard" if pressed else f"not heard within {PRESS_S:g} s", passed=pressed is not None
    )


# --- actuators -----------------------------------------------------------------------------------------------------


async def drive(setting: CommissionSetting) -> bool:
    """A hand's breadth forth and back."""
    if not await is_yes(setting.person, f"The drive will move {STEP_MM} mm forth and back. Is nobody in its way?"):
        setting.leave_out("drive", "somebody was in the way")
        return False
    forth = await move(setting, STEP_MM, SPEED_MM_S)
    back = await move(setting, -STEP_MM, SPEED_MM_S) if forth is not None and forth.has_arrived else None
    if forth is None or back is None or not back.has_arrived:
        return setting.note("drive", f"forth: {forth or 'no position told'}; back: {back or 'not tried'}", passed=False)
    seen = await is_yes(setting.person, "Did it move away from position 1, about a hand's breadth, and come back?")
    return setting.note("drive", f"{forth}; and back: {'seen' if seen else 'not seen'}", passed=seen)


async def shuttle(setting: CommissionSetting) -> bool:
    """The order to retract, which moves nothing where it is home already."""
    shuttle = await setting.devices.first(ShuttleState, REPEAT_S, setting.is_own)
    since = setting.devices.mark()
    number = successor(shuttle.sequence, 8) if shuttle is not None else setting.sequence()
    order = ShuttleOrder(setting.machine.node_id, number, ShuttleAction.RETRACT, Side.NEAR, 0)
    setting.devices.say(order)
    home = await setting.devices.first(
        ShuttleState,
        REPEAT_S,
        lambda one: setting.is_own(one) and one.mode is ShuttleMode.HOME and one.sequence == order.sequence,
        since,
    )
    detail = "obeys the order to retract, and is home" if home else "does not answer the order to retract"
    return setting.note("shuttle", detail, passed=home is not None)


async def doors(setting: CommissionSetting) -> bool:
    """Each door opens and locks again; while one is open the other stays locked, whatever it is ordered."""
    if not await is_yes(setting.person, "Both doors will open and close, one after the other. Is nobody in their way?"):
        setting.leave_out("doors", "somebody was in the way")
        return False
    for door, other in ((DoorName.INPUT, DoorName.OUTPUT), (DoorName.OUTPUT, DoorName.INPUT)):
        opened = await _order_door(setting, door, DoorAction.OPEN, DoorPosition.OPEN)
        held = opened and not await _order_door(setting, other, DoorAction.OPEN, DoorPosition.OPENING)
        locked = await _order_door(setting, door, DoorAction.CLOSE, DoorPosition.LOCKED)
        if not (opened and held and locked):
            what = "does not open" if not opened else "does not lock" if not locked else "is not interlocked"
            return setting.note("doors", f"{door.name.lower()} door {what}", passed=False)
    return setting.note("doors", "both open and lock; while one is open the other stays locked", passed=True)


async def light_and_desk(setting: CommissionSetting) -> bool:
    """A person confirms that the light turns green and then red, and that the desk shows what it was told to."""
    setting.devices.say(LightOrder(setting.machine.node_id, LightColour.GREEN))
    setting.devices.say(DeskOrder(setting.machine.node_id, setting.sequence(), DeskText.OUT_OF_ORDER, NO_REFERENCE))
    green = await setting.devices.first(
        DoorState, REPEAT_S, lambda one: setting.is_own(one) and one.light is LightColour.GREEN
    )
    seen = await is_yes(setting.person, 'Is the light green, and does the desk say "out of order"?')
    setting.devices.say(LightOrder(setting.machine.node_id, LightColour.RED))
    red = await is_yes(setting.person, "Is the light red now?")
    detail = f"green {'told' if green else 'not told'}, {'seen' if seen and red else 'not seen'}"
    return setting.note("light and desk", detail, passed=green is not None and seen and red)


async def _order_door(setting: CommissionSetting, door: DoorName, action: DoorAction, wanted: DoorPosition) -> bool:
    """Whether a door comes to a position within three times what it may take."""
    since = setting.devices.mark()
    setting.devices.say(DoorOrder(setting.machine.node_id, setting.sequence(), door, action))

    def is_there(state: DoorState) -> bool:
        position = state.input_door if door is DoorName.INPUT else state.output_door
        return setting.is_own(state) and position is wanted

    timing = setting.site.timing
    assert isinstance(timing, DeviceTiming), "a site with doors says how long they take"
    within_s = 3 * timing.door_us / 1e6 + 1
    return await setting.devices.first(DoorState, within_s, is_there, since) is not None


# --- the stop chain ------------------------------------------------------------------------------------------------


async def brakes_by_itself(setting: CommissionSetting) -> bool:
    """One order and no more: the drive stops short of the target (DriveTimeOutMs in dbc/device.dbc)."""
    if not await is_yes(setting.person, "The drive will be left without orders on its way. Is nobody in its way?"):
        setting.leave_out("drive without orders", "somebody was in the way")
        return False
    moved = await move(setting, STEP_MM, SPEED_MM_S, orders=1)
    stopped = _has_stopped_short(moved)
    detail = f"{moved or 'no position told'}; back: {await _back(setting, moved)}"
    return setting.note("drive without orders", detail, passed=stopped)


async def emergency_stop(setting: CommissionSetting) -> bool:
    """The independent circuit stops the drive though orders go on."""
    if not await is_yes(
        setting.person,
        f"The drive will move {STEP_MM} mm very slowly. PRESS THE EMERGENCY STOP WHILE IT MOVES. Are you ready?",
    ):
        setting.leave_out("emergency stop", "nobody was ready to press it")
        return False
    moved = await move(setting, STEP_MM, STOP_SPEED_MM_S)
    stopped = _has_stopped_short(moved)
    still = await is_yes(setting.person, "Release the emergency stop. Has the machine stayed where it stopped?")
    detail = f"{moved or 'no position told'}; after the release: {'it stayed' if still else 'IT MOVED'}"
    if still and await is_yes(setting.person, "The drive will move back to where it began. Is nobody in its way?"):
        detail += f"; back: {await _back(setting, moved)}"
    return setting.note("emergency stop", detail, passed=stopped and still)


async def emergency_stop_of_doors(setting: CommissionSetting) -> bool:
    """What only a person can see of doors."""
    seen = await is_yes(setting.person, "Press the emergency stop: do both doors stand still, whatever is ordered?")
    still = await is_yes(setting.person, "Release it: do both doors still stand still?")
    detail = f"doors {'stand' if seen else 'MOVE'}; after the release they {'stand' if still else 'MOVE'}"
    return setting.note("emergency stop", detail, passed=seen and still)


def _has_stopped_short(moved: Moved | None) -> bool:
    return moved is not None and moved.has_moved and abs(moved.to_mm - moved.target_mm) > ARRIVED_MM


async def _back(setting: CommissionSetting, moved: Moved | None) -> str:
    """To the mark at which the drive began, where the controller wants to find it."""
    if moved is None or abs(moved.to_mm - moved.from_mm) <= ARRIVED_MM:
        return "not needed"
    return str(await move(setting, moved.from_mm - moved.to_mm, SPEED_MM_S))


_SENSORS: dict[KindCode, tuple[Step, ...]] = {
    KindCode.ROBOT: (
        _senses(DriveState, "drive's position", _drive_told),
        _senses(ShuttleState, "shuttle's sensors", _shuttle_told),
    ),
    KindCode.LIFT: (
        _senses(DriveState, "platform's position", _drive_told),
        _senses(PlatformState, "platform's sensors", _platform_told),
    ),
    KindCode.COMPARTMENT: (
        _senses(DoorState, "doors' sensors", _doors_told),
        _senses(BayState, "bay's sensors", _bay_told),
        desk_key,
    ),
}
_ACTUATORS: dict[KindCode, tuple[Step, ...]] = {
    KindCode.ROBOT: (drive, shuttle),
    KindCode.LIFT: (drive,),
    KindCode.COMPARTMENT: (doors, light_and_desk),
}
_STOPS: dict[KindCode, tuple[Step, ...]] = {
    KindCode.ROBOT: (brakes_by_itself, emergency_stop),
    KindCode.LIFT: (brakes_by_itself, emergency_stop),
    KindCode.COMPARTMENT: (emergency_stop_of_doors,),
}


def steps_for(kind: KindCode) -> tuple[Step, ...]:
    """Sensors, actuators and stop chain of a kind of machine, in this order; none for a kind without a table."""
    return (*_SENSORS.get(kind, ()), *_ACTUATORS.get(kind, ()), *_STOPS.get(kind, ()))
