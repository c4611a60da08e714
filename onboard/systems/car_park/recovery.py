"""What a robot's journal tells after a restart: which tasks are its own, how far each has come, where it is.

Written before anybody hears of it: an award taken on, a handling that is over, the shuttle's step before its order, a
ride begun and ended. The mirror, bids and plans are not in the journal; the way is planned anew from where the sensors
say that the carrier stands (design, section 5).
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.contract.codes import CallResult, Criterion, KindCode, LegAction, ShuttleMode, TokenKind
from onboard.contract.constants import TASK_VERSION_BITS
from onboard.contract.messages import Award, CallForProposals, CarAt, Reference, ShuttleState
from onboard.core.effects import Record
from onboard.core.journal_records import Entry, JournalRecord, records_in
from onboard.core.records import AssignedRecord, BootRecord, EpochRecord, ReadBackRecord
from onboard.core.serial import is_newer
from onboard.core.site import Segment, Station
from onboard.systems.car_park.bay_memory import cars_at
from onboard.systems.car_park.program import CarHandling, CarStep, HandlingPhase, StationWork
from onboard.systems.car_park.records import (
    AwardRecord,
    FloorRecord,
    ForfeitedRecord,
    HandledRecord,
    RidingRecord,
    SinkRecord,
    StepRecord,
)
from onboard.ways.mirror import WayFleet


def award_record(call: CallForProposals, source: Station, sink: Station, version: int) -> Record:
    """A task taken on under ``version``: what is needed to go on with it, and where its car is taken and left."""
    return Record(
        AwardRecord(
            call.sender,
            call.call,
            call.task,
            call.operation,
            call.car,
            call.wheelbase_mm,
            call.from_station,
            call.to_station,
            call.deadline_ms,
            source.number,
            sink.number,
            version,
        )
    )


def handled_record(work: StationWork) -> Record:
    """The journal's word that one handling of a task is over."""
    return Record(HandledRecord(work.call.task, work.handling, work.station.number, work.car))


def forfeited_record(task: Reference) -> Record:
    """A task was given back, or is another's."""
    return Record(ForfeitedRecord(task))


def sink_record(task: Reference, station: Station) -> Record:
    """The car of a task is to be left at another station than the award says."""
    return Record(SinkRecord(task, station.number))


def ride_record(step: CarStep) -> Record:
    """A ride begins: from now on the floor is the lift's business."""
    return Record(RidingRecord(step.track, step.from_index, step.to_index))


def floor_record(track: int) -> Record:
    """A ride is over: the carrier is on this alley. Or it is about to turn into this spur from its mouth."""
    return Record(FloorRecord(track))


_READ = (
    BootRecord,
    AwardRecord,
    SinkRecord,
    ForfeitedRecord,
    StepRecord,
    HandledRecord,
    RidingRecord,
    FloorRecord,
    AssignedRecord,
    ReadBackRecord,
    EpochRecord,
)


class Done(NamedTuple):
    """A task whose car was left at a station (number); its car is unknown by a journal of before."""

    task: Reference
    station: int
    car: Reference | None


@dataclass
class JournalRecovery:
    """The journal read from its oldest entry on. ``works`` is what is left to do, in order."""

    works: list[StationWork] = field(default_factory=list)
    #: The shuttle's phase in the first of ``works``, None where it was not begun.
    phase: HandlingPhase | None = None
    floor: int | None = None
    #: Lift track, board and leave index of a ride that was begun and not ended.
    riding: tuple[int, int, int] | None = None
    #: Slots that this node got as its rights were made anew, and of which it has not found its place yet.
    told: tuple[Segment, ...] = ()
    #: Slots that lists of rights gave to this node, by epoch; and the epoch of the last list with who was lost.
    _given: dict[int, list[Segment]] = field(default_factory=dict)
    _lost: tuple[int, int] = (0, 0)
    node_id: int = 0
    is_restart: bool = False
    #: The last tasks whose car was left: who asks for one, or awards it anew, is told so. Nobody may have heard of the
    #: last one yet where the shuttle has done nothing since.
    done: deque[Done] = field(default_factory=lambda: deque(maxlen=16))
    is_news: bool = False
    #: Where I have said that cars are.
    cars: dict[Reference, CarAt] = field(default_factory=dict)
    #: Under which version each task was taken on, where it is not the first.
    versions: dict[Reference, int] = field(default_factory=dict)

    @classmethod
    def read(cls, node_id: int, entries: Sequence[Entry]) -> "JournalRecovery":
        """From the journal of node ``node_id``; entries of other kinds are passed over."""
        found = cls(node_id=node_id, cars=cars_at(node_id, entries))
        for record in records_in(entries, *_READ):
            found._take(record)
        return found

    def _take(self, record: JournalRecord) -> None:
        match record:
            case BootRecord():
                self.is_restart = True
            case AwardRecord() if record.source:
                self.forget(record.task)
                self.works += _works(record)
                self.versions[record.task] = record.version
            case SinkRecord():
                place, last = Station.from_number(record.station), (record.task, CarHandling.LEAVE)
                self.works = [
                    one._replace(station=place) if (one.call.task, one.handling) == last else one for one in self.works
                ]
            case ForfeitedRecord():
                self.forget(record.task)
            case StepRecord():
                self.phase, self.is_news = record.phase, False
                measured_mm = record.wheelbase_mm
                self.works[:1] = [one._replace(wheelbase_mm=measured_mm or one.wheelbase_mm) for one in self.works[:1]]
            case HandledRecord():
                ended = (record.task, record.handling)
                self.works = [one for one in self.works if (one.call.task, one.handling) != ended]
                self.phase = None
                if record.handling is CarHandling.LEAVE:
                    # Of the last one alone: a compacted journal has no other.
                    self.done.clear()
                    self._over(Done(record.task, record.station, record.car))
                    self.is_news = True
            case _:
                self._take_place(record)

    def _take_place(self, record: JournalRecord) -> None:
        """Where the carrier is: its own word of a ride or of a track; after lost rights, whose list tells it."""
        match record:
            case RidingRecord():
                self.riding = (record.lift, record.board, record.leave)
            case FloorRecord():
                self.floor, self.riding, self.told = record.track, None, ()
            case AssignedRecord() if (record.kind, record.holder) == (TokenKind.SEGMENT, self.node_id):
                self._given.setdefault(record.epoch, []).append(Segment(record.number >> 8, record.number & 0xFF))
            case ReadBackRecord():
                self._lost = record.epoch, record.lost
            case EpochRecord() if self._lost == (record.epoch, self.node_id):
                self.riding, self.told = None, tuple(self._given.get(record.epoch, ()))

    @property
    def ride(self) -> CarStep | None:
        """The ride that the restart fell into, without its times."""
        if self.riding is None:
            return None
        lift, board, leave = self.riding
        return CarStep(LegAction.RIDE, lift, board, leave, 0, 0)

    def contradiction(self, place: Segment | None, shuttle: ShuttleState) -> str:
        """What the sensors say that the journal cannot explain, in words; empty where they agree.

        ``place`` is where the carrier stands at a mark, None between two; ``shuttle`` has come to rest.
        """
        first = self.works[0] if self.works else None
        begun = first is not None and self.phase is not None
        if shuttle.mode is not ShuttleMode.HOME:
            if first is None or not begun:
                return "the shuttle is out, and the journal knows of no handling"
            if place != first.station.segment:
                return f"the shuttle is out at {place or 'no mark'}, and the journal has it at {first.station}"
            return ""
        if begun:
            # The gripper may just have closed, or opened.
            return ""
        is_loaded = first is not None and first.handling is CarHandling.LEAVE
        if is_loaded and not shuttle.load_kg:
            return "no car is aboard, and the journal has one there"
        if shuttle.load_kg and not is_loaded:
            return "a car is aboard, and the journal knows of none"
        return ""

    def is_under_way(self, place: Segment, shuttle: ShuttleState) -> bool:
        """Whether the first handling was begun and can be gone on with at ``place``; else it is begun anew.

        With the shuttle home a robot may have been pushed away from the station: only what is left to be told is done.
        """
        if self.phase is None or not self.works:
            return False
        first = self.works[0]
        has_gripped = (shuttle.load_kg > 0) is (first.handling is CarHandling.TAKE)
        is_handled = shuttle.mode is ShuttleMode.HOME and self.phase is not HandlingPhase.REACH and has_gripped
        return place == first.station.segment or is_handled

    def untouched(self) -> list[Reference]:
        """Tasks whose car was not taken and whose handling was not begun, in order."""
        begun = self.works[0].call.task if self.works and self.phase is not None else None
        return [one.call.task for one in self.works if one.handling is CarHandling.TAKE and one.call.task != begun]

    @staticmethod
    def is_asked(fleet: WayFleet, award: Award) -> bool:
        """Whether an award to me asks how its task stands: by a call of a life before, of mine or of its initiator."""
        is_mine = award.winner == fleet.node_id and award.result is CallResult.AWARDED
        return is_mine and not fleet.negotiation.knows(award.sender, award.call)

    def is_newer(self, award: Award) -> bool:
        """Whether an award for a task of mine is of a later version than that under which I took it on."""
        return is_newer(award.task_version, self.versions.get(award.task, 1), TASK_VERSION_BITS)

    def left(self, work: StationWork) -> None:
        """A car was left, and its task is over."""
        self._over(Done(work.call.task, work.station.number, work.car))

    def _over(self, done: Done) -> None:
        self.done.append(done)
        self.versions.pop(done.task, None)

    def has_done(self, call: CallForProposals) -> bool:
        """Whether a task is done that was called for anew: its initiator had not heard so.

        The car tells it from one under the same number whose initiator has lost its journal since.
        """
        return any((one.task, one.car) == (call.task, call.car) for one in self.done)

    def forget(self, task: Reference) -> None:
        """A task is another's, or was given back."""
        self.works = [work for work in self.works if work.call.task != task]
        self.versions.pop(task, None)


def _works(record: AwardRecord) -> list[StationWork]:
    call = CallForProposals(
        sender=record.initiator,
        call=record.call,
        task=record.task,
        operation=record.operation,
        kind=KindCode.ROBOT,
        criterion=Criterion.FINISH_TIME,
        attempt=1,
        depth=0,
        deadline_ms=record.deadline_ms,
        from_station=record.from_station,
        to_station=record.to_station,
        car=record.car,
        wheelbase_mm=record.wheelbase_mm,
    )
    ends = ((CarHandling.TAKE, record.source), (CarHandling.LEAVE, record.sink))
    return [
        StationWork(handling, Station.from_number(end), record.car, record.wheelbase_mm, call) for handling, end in ends
    ]
