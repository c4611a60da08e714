"""Motion: only under authority and inside it, and never two bodies in one slot (design, section 5)."""

from collections.abc import Callable, Sequence

from onboard.contract.codes import DriveMode, KindCode
from onboard.contract.messages import DriveOrder, DriveState, Progress
from onboard.core.site import Segment
from onboard.trace.check.event import Finding, LogEvent
from onboard.trace.check.geometry import (
    TOLERANCE_MM,
    ReportedPosition,
    body_at,
    lifts_under,
    occupied,
    sent_through,
    swept,
    token_of,
)
from onboard.trace.check.picture import BusPicture
from onboard.trace.check.rule import Handlers, Rule
from onboard.ways.site import TrackKind, way_site

#: Who was pushed by hand has so long to get the rights to where it is, us: it may have to start first, and to listen
#: until it is admitted (seen: 30 s).
PUSHED_US = 60_000_000
#: An order to a drive waits so long at most for the journal of the rights that permit it, us (seen: 20 ms for five): it
#: crosses the word of the drive that it was pushed meanwhile.
ORDER_CROSSES_US = 100_000
#: Who sets off says where it is at its first border, so within this, us: 5.8 m from rest at 0.5 m/s take 13 s (3.1 s
#: were seen).
SETS_OFF_US = 20_000_000


class InsideAuthority(Rule):
    """A robot's body, its braking distance and the way of each drive order lie in slots that it holds.

    A slot whose holder the log does not tell is counted as not judged. A breach is told when it begins. A body that
    stood and now stands elsewhere was pushed by a person: no controller could have asked before, it must ask at once.
    """

    name = "inside-authority"
    title = "motion only under authority and inside it"
    source = "design 5: authorised() before each movement order and again while it runs"
    needs_site = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        self._told: set[tuple[int, Segment]] = set()
        self._pushed: dict[int, tuple[LogEvent[Progress], ReportedPosition, int]] = {}
        self._stood: dict[int, DriveState] = {}
        self._drive_pushed_us: dict[int, int] = {}
        self._lives: dict[int, int] = {}

    def handlers(self) -> Handlers:
        """Where bodies are, and with device buses where drives are sent."""
        return {Progress: self._on_progress, DriveState: self._on_drive, DriveOrder: self._on_order}

    def _on_drive(self, event: LogEvent[DriveState]) -> None:
        state, before = event.message, self._stood.pop(event.message.sender, None)
        if state.mode is not DriveMode.STANDING:
            return
        self._stood[state.sender] = state
        if before is not None and abs(before.position_mm - state.position_mm) > TOLERANCE_MM:
            self._drive_pushed_us[state.sender] = event.time_us

    def _on_progress(self, event: LogEvent[Progress]) -> None:
        body = self.picture.body_told(event.message, event.time_us)
        if body is None or self.picture.kind(body.node) is not KindCode.ROBOT:
            return
        deceleration = self.picture.ways.carrier.acceleration_mm_s2
        was_pushed = self._was_pushed(body)
        self._pushed.pop(body.node, None)
        if was_pushed:
            self._pushed[body.node] = event, body, event.time_us + PUSHED_US
            return
        braking_mm = body.speed_mm_s * abs(body.speed_mm_s) / (2 * deceleration)
        here = occupied(self.picture.ways, body)
        self._judge(event, body, here, "is in")
        if braking_mm:
            ahead = swept(self.picture.ways, body, body.position_mm + braking_mm)
            self._judge(event, body, [slot for slot in ahead if slot not in here], "cannot stop before")

    def _was_pushed(self, body: ReportedPosition) -> bool:
        before, life = self.picture.bodies.get(body.node), self.picture.boots.get(body.node, 0)
        is_new_life, self._lives[body.node] = life != self._lives.get(body.node, life), life
        if before is None or body.speed_mm_s:
            return False
        if before.speed_mm_s:
            # It drove as its controller failed: nobody has told where it came to rest, before it was pushed.
            return is_new_life
        before_mm = self._seen_from(before, body.track)
        if before_mm is None:
            return False
        return body.node in self._pushed or abs(before_mm - body.position_mm) > TOLERANCE_MM

    def _seen_from(self, body: ReportedPosition, track: int) -> int | None:
        """Where a body is on a track, mm: its own, or one that it could tell as well, turned in a mouth; else None."""
        if body.track == track:
            return body.position_mm
        ways, here = self.picture.ways, Segment(body.track, body.index)
        turned = (*ways.links.get(here, ()), *([ways.mouths[here]] if here in ways.mouths else ()))
        return next((ways.position_mm(place) for place in turned if place.track == track), None)

    def tick(self, now_us: int) -> None:
        """Who was pushed has had its time."""
        if not self._pushed:
            return
        for node, (event, body, due_us) in list(self._pushed.items()):
            if now_us >= due_us:
                del self._pushed[node]
                self._judge(event, body, occupied(self.picture.ways, body), "was pushed, and stays in", now_us)

    def _on_order(self, event: LogEvent[DriveOrder]) -> None:
        body = self.picture.bodies.get(event.message.sender)
        if body is None or self.picture.kind(body.node) is not KindCode.ROBOT:
            return
        if event.time_us - self._drive_pushed_us.get(body.node, -ORDER_CROSSES_US) < ORDER_CROSSES_US:
            return
        site, body = self.picture.site, self.picture.on_floor(body)
        sensed = self.picture.sensed(body)
        if sensed is not None and way_site(site).tracks[body.track].kind is not TrackKind.LIFT:
            slots = sent_through(site, sensed, event.message)
            slots = [slot for slot in slots if not self._leaves_to_another(sensed, slot, event.message)]
            self._judge(event, body, slots, "is sent through")

    def _leaves_to_another(self, body: ReportedPosition, slot: Segment, order: DriveOrder) -> bool:
        """Whether who was pushed is sent out of a slot in which another stands: it can have no right to that."""
        ways, aim = self.picture.ways, body_at(self.picture.site, body, order.target_mm)
        # It may not have said so yet: its words wait behind others' frames, and orders do not.
        was_pushed = body.node in self._pushed or self._drive_pushed_us.get(body.node, 0) > body.time_us
        if not was_pushed or not slot.track == body.track == aim.track:
            return False
        goes_away = (ways.position_mm(slot) - body.position_mm) * (aim.position_mm - body.position_mm) < 0
        others = [other for node, other in self.picture.bodies.items() if node != body.node and not other.speed_mm_s]
        return goes_away and any(slot in occupied(ways, other) for other in others)

    def _judge(
        self,
        event: LogEvent[Progress] | LogEvent[DriveOrder],
        body: ReportedPosition,
        slots: Sequence[Segment],
        how: str,
        now_us: int | None = None,
    ) -> None:
        tokens, at_us = self.picture.tokens, event.time_us if now_us is None else now_us
        for slot in slots:
            token = token_of(slot)
            holder = tokens.holder(token)
            self.picture.unjudged += holder is None
            if holder == body.node or tokens.may_use(token, body.node, at_us):
                if self._told:
                    self._told.discard((body.node, slot))
            elif (body.node, slot) not in self._told:
                self._told.add((body.node, slot))
                self.find(event, (body.node,), f"{how} {slot}, which {holder} holds")


class OneBody(Rule):
    """No two robots closer than a carrier's length on a track, no two on one platform, none at the mouth of another."""

    name = "one-body"
    title = "no two bodies in one slot or platform"
    source = "issue 4, point 1; row P36"
    needs_site = True

    def __init__(self, picture: BusPicture, report: Callable[[Finding], None]) -> None:
        super().__init__(picture, report)
        tracks = way_site(picture.site).tracks.values()
        #: Of each track that has linked ends, their mouths.
        self._mouths = {track.number: [mouth for _, mouth in track.ends] for track in tracks if track.ends}
        self._robots = {node for node in picture.site.machines if picture.kind(node) is KindCode.ROBOT}
        #: Who was pushed to another, which may have set off since its last word: until when that is to say so.
        self._crossed: dict[tuple[int, int], tuple[LogEvent[Progress], int]] = {}

    def handlers(self) -> Handlers:
        """Reads where bodies say that they are."""
        return {Progress: self._on_progress}

    def _on_progress(self, event: LogEvent[Progress]) -> None:
        ways, body = self.picture.ways, self.picture.body_told(event.message, event.time_us)
        if body is None or body.node not in self._robots:
            return
        lifts = lifts_under(ways, body)
        self._crossed = {pair: word for pair, word in self._crossed.items() if pair[1] != body.node}
        for other in self.picture.bodies.values():
            if other.node == body.node or other.node not in self._robots:
                continue
            if self._are_near(body, other):
                self._judge_near(event, body, other)
            for lift in sorted(lifts & lifts_under(ways, other)) if lifts else ():
                self.find(event, (body.node, other.node), f"both on the platform of lift {lift}")
            if body.track not in self._mouths and other.track not in self._mouths:
                continue
            for one, two in ((body, other), (other, body)):
                if two.track in self._mouths and self._is_in_mouth_of(one, two):
                    self.find(event, (body.node, other.node), f"{one.node} in the mouth of {self._name(two.track)}")

    def _judge_near(self, event: LogEvent[Progress], body: ReportedPosition, other: ReportedPosition) -> None:
        apart_mm, pair = other.position_mm - body.position_mm, (body.node, other.node)
        # Who drove away when it last spoke is farther by now: its power may have failed before its next word.
        is_gone = apart_mm * other.speed_mm_s > 0
        before = self.picture.bodies.get(body.node)
        if before is not None and not before.speed_mm_s and not body.speed_mm_s and not self._are_near(before, other):
            self._crossed.setdefault(pair, (event, event.time_us + SETS_OFF_US))
        if not is_gone and pair not in self._crossed:
            self._find_near(event, body, other)

    def tick(self, now_us: int) -> None:
        """Who did not say that it has set off stands there."""
        for pair, (event, due_us) in list(self._crossed.items()):
            if now_us >= due_us:
                del self._crossed[pair]
                body, other = (self.picture.bodies.get(node) for node in pair)
                if body is not None and other is not None and self._are_near(body, other):
                    self._find_near(event, body, other)

    def _are_near(self, one: ReportedPosition, two: ReportedPosition) -> bool:
        near_mm = self.picture.ways.carrier_length_mm - TOLERANCE_MM
        return one.track == two.track and abs(one.position_mm - two.position_mm) < near_mm

    def _find_near(self, event: LogEvent[Progress], body: ReportedPosition, other: ReportedPosition) -> None:
        apart_mm = abs(other.position_mm - body.position_mm)
        self.find(event, (body.node, other.node), f"{apart_mm} mm apart on track {body.track}")

    def _name(self, track: int) -> str:
        kind = self.picture.ways.tracks[track].kind
        return f"{'spur' if kind is TrackKind.SPUR else 'track'} {track}"

    def _is_in_mouth_of(self, one: ReportedPosition, two: ReportedPosition) -> bool:
        """Whether a body is where another turns into a track, or comes out of it."""
        ways = self.picture.ways
        here = occupied(ways, two)
        for mouth in self._mouths[two.track]:
            if mouth not in here:
                continue
            apart_mm = abs(one.position_mm - ways.position_mm(mouth))
            if one.track == mouth.track and apart_mm < ways.carrier_length_mm - TOLERANCE_MM:
                return True
            if one.track not in (mouth.track, two.track) and mouth in occupied(ways, one):
                return True
        return False
