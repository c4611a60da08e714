"""What a person asks for, by the names of the site file, and the order that it becomes."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from onboard.contract.codes import Reason
from onboard.contract.constants import MOBILE_KINDS, NOBODY
from onboard.core.journal_state import RIGHTS_LOST
from onboard.core.site import Machine, Site
from onboard.holon.remedies import START_ANEW, remedy
from onboard.operate.assignment import BodySlots
from onboard.operate.blocks import Mark
from onboard.operate.change import ChangeCommand
from onboard.operate.holds import HoldCommand
from onboard.operate.names import OperateError, machine_of, movable_of, node_of, reason_of, segment_of, slot_of
from onboard.operate.order import OperatorCommand
from onboard.operate.park import Park
from onboard.operate.regenerate import Lost, Regenerate
from onboard.operate.status import Status
from onboard.operate.stops import GoAgain, LetGo, StopCommand
from onboard.ways.site import way_site

#: Heartbeat periods for which the bus is listened to before anything is said: everybody is heard, and once lost.
LISTEN_BEATS = 2

#: A body that is in no slot of the site any more.
GONE = "gone"

#: Makes the order from what was heard and the station's node-ID. May raise ``OperateError``.
Maker = Callable[[Park, int], OperatorCommand]


@dataclass(frozen=True, slots=True)
class CommandRequest:
    """One command and its settings; those that it has no use for are as they are. ``for_us`` in us, None: not given."""

    command: str
    machine: str = ""
    segment: str = ""
    reason: str = "operator"
    of: str = ""
    for_us: int | None = None
    #: Of regenerate: slots in which the machine's body is, who is locked off, and the slots of that one.
    body: tuple[str, ...] = ()
    absent: str = ""
    absent_body: tuple[str, ...] = ()
    #: Of change-site: the digest of the site file that the new one follows.
    replaces: int = 0


def maker_of(site: Site, asked: CommandRequest, seed: int) -> Maker:
    """What makes the order. Raises ``OperateError`` for what the site does not have. ``seed`` as in ``HoldCommand``."""
    match asked.command:
        case "status":
            listen_us = asked.for_us or LISTEN_BEATS * site.timing.heartbeat_us
            return partial(Status, listen_us=listen_us)
        case "stop":
            return partial(StopCommand, keep_us=asked.for_us)
        case "go":
            return partial(GoAgain, stopper=node_of(site, asked.of) if asked.of else NOBODY)
        case "block":
            segment, reason = segment_of(site, asked.segment), reason_of(asked.reason)
            return partial(Mark, segment=segment, reason=reason, blocks=True)
        case "clear":
            return partial(Mark, segment=segment_of(site, asked.segment), reason=Reason.OPERATOR, blocks=False)
        case "hold":
            return partial(HoldCommand, machine=movable_of(site, asked.machine), holds=True, seed=seed)
        case "release":
            return partial(_release, site=site, machine=machine_of(site, asked.machine), seed=seed)
    return _maker_of_change(site, asked)


def _maker_of_change(site: Site, asked: CommandRequest) -> Maker:
    """The same of what changes the rights, or the site."""
    match asked.command:
        case "change-site":
            return partial(ChangeCommand, old=asked.replaces)
        case "regenerate":
            return partial(_regenerate, site=site, who=_lost_of(site, asked))
    raise OperateError(f"{asked.command}: no command")


def _lost_of(site: Site, asked: CommandRequest) -> Lost:
    """Who lost its rights, who is locked off, and where their bodies are. Raises ``OperateError``."""
    ways = way_site(site)
    lost = machine_of(site, asked.machine)
    if not site.has_regeneration:
        raise OperateError(
            f"{asked.machine}: {site.name} is a {site.called}; only a car park's rights can be made anew; {START_ANEW}"
        )
    if asked.absent == asked.machine:
        return Lost(lost.node_id, lost.node_id, blocked=_body_of(site, lost, asked.body, "--body"))
    body = _body_of(site, lost, asked.body, "--body")
    tracks = {slot.track for slot in body.slots}
    alleys = tracks.difference(ways.lifts)
    is_one_place = len(alleys) <= 1 or (len(alleys) == 2 and ways.turned_into(body.slots) is not None)
    if lost.kind in MOBILE_KINDS and (not is_one_place or len(tracks - alleys) > 1 or not tracks):
        raise OperateError(
            f"--body: {lost.name} must stand on one track, in one lift, or between two that meet; push it there first"
        )
    if not asked.absent:
        return Lost(lost.node_id, body=body)
    absent = machine_of(site, asked.absent)
    return Lost(lost.node_id, absent.node_id, body, _body_of(site, absent, asked.absent_body, "--absent-body"))


def _regenerate(park: Park, node: int, *, site: Site, who: Lost) -> OperatorCommand:
    """What was heard of the site already may speak against it. Raises ``OperateError``."""
    seen = who.body.slots | who.blocked.slots
    for known in park.machines.values():
        # The latest word about it, however old: the time is not asked for here.
        word, machine = known.halted, known.machine
        if word is not None and word.reason is Reason.JOURNAL_FOREIGN and machine.node_id != who.absent:
            raise OperateError(
                f"{machine.name}: its journal is another machine's: {remedy(site, word.reason, machine.name)}"
            )
        at = park.where(machine.node_id)
        if machine.kind in MOBILE_KINDS and machine.node_id not in (who.lost, who.absent) and at in map(str, seen):
            raise OperateError(f"--body {at}: {machine.name} is there by its own word; look again")
    return Regenerate(park, node, who)


def _body_of(site: Site, machine: Machine, slots: tuple[str, ...], option: str) -> BodySlots:
    """Where a person sees a body: one that moves is told, one that does not is known."""
    if machine.kind not in MOBILE_KINDS:
        return BodySlots.of_fixed(site, machine)
    if not slots:
        raise OperateError(
            f"{machine.name}: where does it stand? {option} 'p(1,3)' for each slot of it, or {option} gone"
        )
    return BodySlots.of_segments(site, [slot_of(site, text) for text in slots if text != GONE])


def _release(park: Park, node: int, *, site: Site, machine: Machine, seed: int) -> OperatorCommand:
    """A machine that says that it holds goes on by ``Go`` under its number; any other was held by a ``ManualOrder``."""
    # The latest word about it, however old: the time is not asked for here.
    word = park.machines[machine.node_id].halted
    if word is not None and word.reason in RIGHTS_LOST:
        then = remedy(site, word.reason, machine.name)
        raise OperateError(f"{machine.name}: its journal does not know its rights; {then}")
    if word is not None and word.reason is Reason.EMERGENCY_STOP:
        raise OperateError(f"{machine.name}: holds by an emergency stop; onboard operate go")
    if word is not None and word.sender == machine.node_id:
        return LetGo(park, node, machine)
    return HoldCommand(park, node, movable_of(site, machine.name), holds=False, seed=seed)
