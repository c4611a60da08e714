"""What has been on a bus so far, for all rules together. A rule is shown an event before the picture takes it up."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from onboard.contract.codes import KindCode, MachineState, ManualMode, Reason
from onboard.contract.constants import STILL
from onboard.contract.messages import (
    BusTime,
    DriveState,
    Halted,
    Heartbeat,
    ManualState,
    Message,
    Progress,
    Regeneration,
    TokenAssigned,
    TokenGrant,
    TokenHeld,
)
from onboard.core.journal_state import RIGHTS_LOST
from onboard.core.serial import from_bus_ms
from onboard.core.site import Segment, Site
from onboard.trace.check.geometry import ReportedPosition, body_at, body_of, floors_of
from onboard.trace.check.tokens_seen import TokensSeen
from onboard.ways.site import WaySite, way_site

#: A machine that was not heard for so long counts as silent, us: three missing heartbeats (dbc/fleet.dbc).
SILENT_US = 7_000_000
#: No bus delay explains that bus time and the log differ by more than this from before, us.
JUMP_US = 100_000
#: A clock that is far off is set anew by the second word, and that comes within two periods of 5 s, us.
SETTLING_US = 11_000_000
#: What a machine says that has stopped itself: others may have to wait for it, and it for a person.
_STOPPED = (Reason.ACTUATOR_FAULT, Reason.SENSOR_FAULT)


class BusPicture:
    """Bus time, holders of tokens, places of bodies and lives of machines, from the frames alone.

    ``disturbed`` is true where frames may have been lost, doubled or delayed on purpose; ``site`` None where no site
    file was given.
    """

    def __init__(self, site: Site | None, *, disturbed: bool = False) -> None:
        self.disturbed = disturbed
        #: The time of the log, us, as whoever feeds the picture tells it.
        self.now_us = 0
        self.offset_us: int | None = None
        self.tokens = TokensSeen(site)
        self.bodies: dict[int, ReportedPosition] = {}
        #: Where drives last said that they are, mm by their own tape, by node: only on device buses.
        self._sensed_mm: dict[int, int] = {}
        #: Boot counter and last sign of life, us of the log, by node.
        self.boots: dict[int, int] = {}
        self.heard_us: dict[int, int] = {}
        #: The sign of life of each node that was taken up last: one that differs in its mirror's digest only, which
        #: nothing here reads, tells only that its sender lives.
        self.beats: dict[int, Heartbeat] = {}
        #: Each machine's first sign of life, us of the log.
        self.first_us: dict[int, int] = {}
        #: Machines that start, or hold for their journals: what they say that they hold is for the others to compare.
        self.announcing: set[int] = set()
        #: Things that could not be judged, because the log does not tell enough.
        self.unjudged = 0
        #: Until then machines were broken on purpose, us of the log: no rule of liveness counts time before it.
        self.excused_us = 0
        #: Machines that a person holds, or that have stopped and call for one: while there are any, and until they go
        #: on, no such time counts either.
        self.held: set[int] = set()
        self._stopped: set[int] = set()
        #: Bus time has jumped: until then (us of the log) machines wait for a second word, and decide no call.
        self.clock_settles_us = 0
        self._site = site
        self._ways = way_site(site) if site is not None else None
        machines = site.machines.values() if site is not None else ()
        self._kinds = {machine.node_id: machine.kind for machine in machines}
        #: The body that was told of last, by what and when.
        self._told: tuple[Progress | None, int, ReportedPosition | None] = None, 0, None
        #: What the picture is made of, and what takes it up at a time in us, after the rules have seen it: half of what
        #: is said on a bus is none of it.
        self.taken: dict[type[Message], Callable[[Any, int], None]] = {
            TokenGrant: self.tokens.on_grant,
            TokenHeld: self.tokens.on_held,
            **dict.fromkeys((TokenAssigned, Regeneration), self.tokens.on_operator),
            Heartbeat: self._on_heartbeat,
            BusTime: self._on_bus_time,
            Progress: self._on_progress,
            DriveState: self._on_drive,
            ManualState: self._on_manual,
            Halted: self._on_halted,
        }

    @property
    def site(self) -> Site:
        """The site. Raises ``ValueError`` where none was given: rules that need one are left out then."""
        if self._site is None:
            raise ValueError("this rule needs the site file")
        return self._site

    @property
    def ways(self) -> WaySite:
        """The site with its tracks. Raises ``ValueError`` as ``site`` does."""
        if self._ways is None:
            raise ValueError("this rule needs the site file")
        return self._ways

    @property
    def has_site(self) -> bool:
        """Whether the site is known."""
        return self._site is not None

    @property
    def spoiled_until_us(self) -> int:
        """Until then, us of the log, somebody may have spoken between a machine's words and their seal: they are void.

        Only what is proved is judged where seals are required; 0 where all that is said counts.
        """
        return self.excused_us if self.is_sealed else 0

    @property
    def is_sealed(self) -> bool:
        """Whether only what is sealed counts on this site."""
        return self._site is not None and self._site.seals == "required"

    def waited_us(self, since_us: int, now_us: int) -> int:
        """How long something has been due, for rules of liveness: from ``since_us``, or from the end of all faults.

        Nothing is due while somebody is held, for others may have to wait for it.
        """
        if self.held or self._stopped:
            return 0
        return now_us - max(since_us, self.excused_us)

    def kind(self, node: int) -> KindCode | None:
        """Kind of a machine by the site file."""
        return self._kinds.get(node)

    def bus_us(self, time_us: int) -> int | None:
        """Bus time at a time of the log; None before anybody told it. Low by the time that a frame takes."""
        return time_us - self.offset_us if self.offset_us is not None else None

    def log_us(self, bus_ms: int, near_us: int) -> int | None:
        """The time of the log nearest to ``near_us`` at which bus time reads ``bus_ms``."""
        if self.offset_us is None:
            return None
        return from_bus_ms(bus_ms, near_us - self.offset_us) + self.offset_us

    def is_alive(self, node: int, boot: int | None) -> bool:
        """Whether a machine is heard and still in the life that had this boot counter; None for not known."""
        return self.boots.get(node) == boot and self.now_us - self.heard_us.get(node, 0) <= SILENT_US

    def on_floor(self, body: ReportedPosition) -> ReportedPosition:
        """A carrier on a platform is at the floor where its lift is, which it tells only when it moves on."""
        lift_track = way_site(self.site).platforms.get(Segment(body.track, body.index))
        lift = self.bodies.get(self.site.stewards[lift_track]) if lift_track is not None else None
        if lift_track is None or lift is None or body.track in floors_of(self.site, lift):
            return body
        ways, floor = way_site(self.site), floors_of(self.site, lift)[0]
        at = next(ways.beyond(sill) for sill in ways.tracks[lift_track].joins if sill.track == floor)
        return replace(body, track=at.track, index=at.index, position_mm=ways.position_mm(at))

    def sensed(self, body: ReportedPosition) -> ReportedPosition | None:
        """A body where its drive says that it is, told oftener than ``Progress``; None before any word of it."""
        sensed_mm = self._sensed_mm.get(body.node)
        return None if sensed_mm is None else body_at(self.site, body, sensed_mm)

    def _on_heartbeat(self, beat: Heartbeat, time_us: int) -> None:
        if not self.boots:
            # The first sign of life of a whole site in its first life: all tokens are where the site file says.
            self.tokens.from_start = beat.boot == 1 and beat.state is MachineState.STARTING
        if beat.state not in STILL and beat.sender in self._stopped:
            self._stopped.discard(beat.sender)
            self.excused_us = max(self.excused_us, time_us)
        self.first_us.setdefault(beat.sender, time_us)
        self.boots[beat.sender], self.beats[beat.sender] = beat.boot, beat
        self.heard_us[beat.sender] = time_us
        if beat.state is MachineState.STARTING:
            self.announcing.add(beat.sender)
        elif beat.state not in STILL:
            self.announcing.discard(beat.sender)

    def _on_progress(self, progress: Progress, time_us: int) -> None:
        body = self.body_told(progress, time_us)
        if body is not None:
            self.bodies[progress.sender] = body

    def body_told(self, progress: Progress, time_us: int) -> ReportedPosition | None:
        """The body that a message tells of, worked out once for all rules; None where the site has no such track."""
        if self._ways is None:
            return None
        told, told_us, body = self._told
        if told is not progress or told_us != time_us:
            body = body_of(self._ways, progress, time_us)
            self._told = progress, time_us, body
        return body

    def _on_drive(self, state: DriveState, _time_us: int) -> None:
        self._sensed_mm[state.sender] = state.position_mm

    def _on_halted(self, word: Halted, _time_us: int) -> None:
        self.beats.pop(word.sender, None)
        if word.sender == word.machine and word.needs_person and word.reason in _STOPPED:
            self._stopped.add(word.sender)
        if word.sender == word.machine and word.reason in RIGHTS_LOST:
            self.announcing.add(word.sender)

    def _on_bus_time(self, said: BusTime, time_us: int) -> None:
        before_us, self.offset_us = self.offset_us, time_us - said.bus_time_us
        if before_us is not None and abs(self.offset_us - before_us) > JUMP_US:
            self.clock_settles_us = max(self.clock_settles_us, time_us + SETTLING_US)

    def _on_manual(self, state: ManualState, time_us: int) -> None:
        if state.manual_mode is not ManualMode.AUTOMATIC:
            self.held.add(state.sender)
        elif state.sender in self.held:
            self.held.discard(state.sender)
            self.excused_us = max(self.excused_us, time_us)
