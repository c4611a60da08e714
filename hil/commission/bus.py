"""The steps on the fleet bus: termination, listening, node-ID, digests; and, at the end, the new machine among them."""

from hil.commission.person import is_yes, number
from hil.commission.setting import CommissionSetting
from onboard.contract.codes import CONTRACT_VERSION, MachineState
from onboard.contract.messages import Diagnostic, DoorOrder, DriveOrder, Heartbeat, ShuttleOrder
from onboard.core.mirror import MISSED_HEARTBEATS
from onboard.ports.bus import ErrorState

#: Two terminators of 120 ohms in parallel (ISO 11898-2), each within a tenth.
TERMINATION_OHM = (54.0, 66.0)
#: Above this one terminator is missing; below the other three or more are there, or there is a short.
_ONE_MISSING_OHM, _TOO_MANY_OHM = 66.0, 54.0
#: From power to a heartbeat, and from there to taking part, s: a board may boot for two minutes.
JOIN_S, PART_S = 180.0, 60.0
_TAKING_PART = (MachineState.IDLE, MachineState.WORKING, MachineState.WAITING)


async def termination(setting: CommissionSetting) -> bool:
    """The resistance between both wires with all power off, as read by the person."""
    ohm = await number(
        setting.person,
        "Switch all machines off. Resistance between CAN-H and CAN-L at the new machine's plug, in ohms?",
    )
    if ohm is None:
        setting.leave_out("termination", "no reading was given")
        return True
    low, high = TERMINATION_OHM
    remedy = ""
    if ohm > _ONE_MISSING_OHM:
        remedy = "; a terminator is missing, or the cable is broken: 120 ohms at both ends of the bus"
    elif ohm < _TOO_MANY_OHM:
        remedy = "; more than two terminators, or a short: 120 ohms at both ends and nowhere else"
    reading = f"{ohm:g} ohms, wanted {low:g} to {high:g}{remedy}"
    return setting.note("termination", reading, passed=low <= ohm <= high)


async def listening(setting: CommissionSetting) -> bool:
    """Every machine of the site has had the time to be heard several times, and nobody speaks for the new one."""
    if not await is_yes(
        setting.person, f"Switch the fleet on, but not the controller of {setting.machine.name}. Is that done?"
    ):
        setting.leave_out("listening", "the fleet was not switched on")
        return False
    for_s = max(1.0, (MISSED_HEARTBEATS + 1) * setting.site.timing.heartbeat_us / 1e6)
    setting.person.tell(f"Listening for {for_s:g} s, without a word ...")
    await setting.fleet.listen(for_s)
    health = setting.fleet.bus.health()
    names = _names(setting, {one.sender for one in _beats(setting)})
    heard = (
        f"{setting.fleet.frames} frames in {for_s:g} s of {', '.join(names) or 'nobody'}; "
        f"frames of no contract: {setting.fleet.foreign_frames}, error frames: {setting.fleet.error_frames}, "
        f"TEC {health.tec}, REC {health.rec}"
    )
    quiet = (
        setting.fleet.error_frames == 0 and health.state is ErrorState.ERROR_ACTIVE and not (health.tec or health.rec)
    )
    if not names:
        heard += "; nobody is heard: wrong interface, wrong bit rate, or a broken cable"
    return setting.note("listening", heard, passed=quiet and bool(names)) or bool(names)


async def node_id_free(setting: CommissionSetting) -> bool:
    """Nobody speaks under the node-ID of the new machine; on its device bus nobody gives orders."""
    node = setting.machine.node_id
    frames = setting.fleet.senders[node]
    orders = [one for _, one in setting.devices.heard if isinstance(one, DriveOrder | ShuttleOrder | DoorOrder)]
    own = [one for one in orders if setting.is_own(one)]
    if own:
        detail = f"somebody gives orders on the device bus ({type(own[0]).__name__}): switch that controller off"
        return setting.note("node-ID", detail, passed=False)
    if frames:
        return setting.note("node-ID", f"{node} is taken: {frames} frames were heard under it", passed=False)
    return setting.note("node-ID", f"{node} is free", passed=True)


async def digests(setting: CommissionSetting) -> bool:
    """All speak this contract and have this very site file."""
    wrong = {
        one.sender: f"contract {one.contract}, site {one.site_digest:04X}"
        for one in _beats(setting)
        if (one.contract, one.site_digest) != (CONTRACT_VERSION, setting.site.digest)
    }
    ours = f"contract {CONTRACT_VERSION}, site {setting.site.digest:04X}"
    if not wrong:
        return setting.note("digests", f"all have {ours}", passed=True)
    others = ", ".join(f"{_name(setting, node)} {what}" for node, what in sorted(wrong.items()))
    return setting.note("digests", f"here {ours}, but {others}: give all the same site file", passed=False)


async def joins(setting: CommissionSetting) -> bool:
    """The controller is switched on, is the machine that it should be, and takes part."""
    since = setting.fleet.mark()
    await setting.person.ask(f"Switch the controller of {setting.machine.name} on, then press Enter.")
    beat = await setting.fleet.first(Heartbeat, JOIN_S, setting.is_own, since)
    if beat is None:
        return setting.note("joins", f"no heartbeat within {JOIN_S:g} s", passed=False)
    heard = (beat.contract, beat.site_digest, beat.kind)
    if heard != (CONTRACT_VERSION, setting.site.digest, setting.machine.kind):
        detail = f"it tells contract {beat.contract}, site {beat.site_digest:04X}, kind {beat.kind.name.lower()}"
        return setting.note("joins", detail, passed=False)

    def takes_part() -> Heartbeat | None:
        latest = {one.sender: one for _, one in setting.fleet.heard[since:] if isinstance(one, Heartbeat)}
        own = latest.pop(setting.machine.node_id, None)
        agree = own is not None and any(one.mirror_digest == own.mirror_digest for one in latest.values())
        return own if own is not None and agree and own.state in _TAKING_PART else None

    ready = await setting.fleet.notice.until(takes_part, PART_S)
    drops = [one for _, one in setting.fleet.heard[since:] if isinstance(one, Diagnostic) and setting.is_own(one)]
    dropped = ", ".join(f"{one.reason.name.lower()} {one.count}" for one in drops) or "nothing"
    if ready is None:
        state = f"it does not take part within {PART_S:g} s; input dropped: {dropped}"
        return setting.note("joins", state, passed=False)
    detail = f"boot {ready.boot}, {ready.state.name.lower()}, mirror {ready.mirror_digest:04X}; dropped: {dropped}"
    return setting.note("joins", detail, passed=True)


def _beats(setting: CommissionSetting) -> list[Heartbeat]:
    return [one for _, one in setting.fleet.heard if isinstance(one, Heartbeat)]


def _names(setting: CommissionSetting, nodes: set[int]) -> list[str]:
    return [_name(setting, node) for node in sorted(nodes)]


def _name(setting: CommissionSetting, node: int) -> str:
    machine = setting.site.machines.get(node)
    return machine.name if machine is not None else f"node {node}"
