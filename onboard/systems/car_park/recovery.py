"""What a robot's journal tells after a restart: which tasks are its own, how far each has come, where it is.

Written before anybody hears of it: an award taken on, a handling that is over, the shuttle's step before its order, a
ride begun and ended. The mirror, bids and plans are not in the journal; the way is planned anew from where the sensors
say that the carrier stands (design, section 5).
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from onboard.core.codes import (
    TASK_VERSION_BITS,
    CallResult,
    Criterion,
    KindCode,
    LegAction,
    Operation,
    Reason,
    ShuttleMode,
    TaskPhase,
)
from onboard.core.effects import Effect, Record, Send
from onboard.core.messages import Award, CallForProposals, CarAt, Reference, ShuttleState, TaskReport
from onboard.core.serial import is_newer
from onboard.core.site import Segment, Station
from onboard.systems.car_park.bay_memory import cars_at
from onboard.systems.car_park.handling import Phase
from onboard.systems.car_park.program import Handling, Step, Work
from onboard.ways.mirror import WayFleet

Entry = Mapping[str, str | int]


def award_record(call: CallForProposals, source: Station, sink: Station, version: int) -> Record:
    """A task taken on under ``version``: what is needed to go on with it, and where its car is taken and left."""
    entry: dict[str, str | int] = {"record": "award", "initiator": call.sender, "call": call.call}
    entry |= {"task_origin": call.task.origin, "task": call.task.number, "operation": int(call.operation)}
    entry |= {"car_origin": call.car.origin, "car": call.car.number, "wheelbase_mm": call.wheelbase_mm}
    entry |= {"from_station": call.from_station, "to_station": call.to_station, "deadline_ms": call.deadline_ms}
    return Record(entry | {"source": source.number, "sink": sink.number, "version": version})


def handled_record(work: Work) -> Record:
    """A handling is over."""
    task = work.call.task
    entry: dict[str, str | int] = {"record": "handled", "task_origin": task.origin, "task": task.number}
    return Record(entry | {"handling": work.handling.value, "station": work.station.number})


def forfeited_record(task: Reference) -> Record:
    """A task was given back, or is another's."""
    return Record({"record": "forfeited", "task_origin": task.origin, "task": task.number})


def sink_record(task: Reference, station: Station) -> Record:
    """The car of a task is to be left at another station than the award says."""
    entry: dict[str, str | int] = {"record": "sink", "task_origin": task.origin, "task": task.number}
    return Record(entry | {"station": station.number})


def ride_record(step: Step) -> Record:
    """A ride begins: from now on the floor is the lift's business."""
    return Record({"record": "riding", "lift": step.track, "board": step.from_index, "leave": step.to_index})


def floor_record(track: int) -> Record:
    """A ride is over: the carrier is on this alley. Or it is about to turn into this spur from its mouth."""
    return Record({"record": "floor", "track": track})


@dataclass
class Recovery:
    """The journal read from its oldest entry on. ``works`` is what is left to do, in order."""

    works: list[Work] = field(default_factory=list)
    #: The shuttle's phase in the first of ``works``, None where it was not begun.
    phase: Phase | None = None
    floor: int | None = None
    #: Lift track, board and leave index of a ride that was begun and not ended.
    riding: tuple[int, int, int] | None = None
    is_restart: bool = False
    #: The last task whose car was left, and the number of its station: who asks for it is told so. Nobody may have
    #: heard of it yet where the shuttle has done nothing since.
    last_done: tuple[Reference, int] | None = None
    is_news: bool = False
    #: Where I have said that cars are.
    cars: dict[Reference, CarAt] = field(default_factory=dict)
    #: Under which version each task was taken on, where it is not the first.
    versions: dict[Reference, int] = field(default_factory=dict)

    @classmethod
    def read(cls, node_id: int, entries: Sequence[Entry]) -> "Recovery":
        """From the journal of node ``node_id``; entries of other kinds are passed over."""
        found = cls(cars=cars_at(node_id, entries))
        for entry in entries:
            found._take(entry)
        return found

    def _take(self, entry: Entry) -> None:
        match entry.get("record"):
            case "boot":
                self.is_restart = True
            case "award" if "source" in entry:
                self.forget(_task(entry))
                self.works += _works(entry)
                self.versions[_task(entry)] = int(entry.get("version", 1))
            case "sink":
                place = Station.from_number(int(entry["station"]))
                leave = Handling.LEAVE
                self.works = [
                    one._replace(station=place) if (one.call.task, one.handling) == (_task(entry), leave) else one
                    for one in self.works
                ]
            case "forfeited":
                self.forget(_task(entry))
            case "step":
                self.phase, self.is_news = Phase(str(entry["phase"])), False
            case "handled":
                self.works = [work for work in self.works if not _is(work, entry)]
                self.phase = None
                if entry["handling"] == Handling.LEAVE.value:
                    self.versions.pop(_task(entry), None)
                    self.last_done, self.is_news = (_task(entry), int(entry.get("station", 0))), True
            case "riding":
                self.riding = (int(entry["lift"]), int(entry["board"]), int(entry["leave"]))
            case "floor":
                self.floor, self.riding = int(entry["track"]), None

    @property
    def ride(self) -> Step | None:
        """The ride that the restart fell into, without its times."""
        if self.riding is None:
            return None
        lift, board, leave = self.riding
        return Step(LegAction.RIDE, lift, board, leave, 0, 0)

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
        is_loaded = first is not None and first.handling is Handling.LEAVE
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
        has_gripped = (shuttle.load_kg > 0) is (first.handling is Handling.TAKE)
        is_handled = shuttle.mode is ShuttleMode.HOME and self.phase is not Phase.REACH and has_gripped
        return place == first.station.segment or is_handled

    def untouched(self) -> list[Reference]:
        """Tasks whose car was not taken and whose handling was not begun, in order."""
        begun = self.works[0].call.task if self.works and self.phase is not None else None
        return [one.call.task for one in self.works if one.handling is Handling.TAKE and one.call.task != begun]

    def forfeit_unknown(
        self, fleet: WayFleet, award: Award, known: Iterable[Work], done: Collection[Reference]
    ) -> list[Effect]:
        """An award for a bid of my life before: the bid is not in the journal, so the task is given back at once."""
        mine = award.winner == fleet.node_id and award.result is CallResult.AWARDED
        if not mine or not self.is_restart or fleet.negotiation.knows(award.sender, award.call):
            return []
        if any(work.call.task == award.task for work in known) or award.task in done:
            return []
        return [Send(TaskReport(fleet.node_id, award.task, TaskPhase.FORFEITED, 0, Reason.JOURNAL_LOST))]

    def is_newer(self, award: Award) -> bool:
        """Whether an award for a task of mine is of a later version than that under which I took it on."""
        return is_newer(award.task_version, self.versions.get(award.task, 1), TASK_VERSION_BITS)

    def forget(self, task: Reference) -> None:
        """A task is another's, or was given back."""
        self.works = [work for work in self.works if work.call.task != task]
        self.versions.pop(task, None)


def _task(entry: Entry) -> Reference:
    return Reference(int(entry["task_origin"]), int(entry["task"]))


def _is(work: Work, entry: Entry) -> bool:
    return work.call.task == _task(entry) and work.handling.value == entry["handling"]


def _works(entry: Entry) -> list[Work]:
    number = {name: int(value) for name, value in entry.items() if name != "record"}
    car = Reference(number["car_origin"], number["car"])
    call = CallForProposals(
        sender=number["initiator"],
        call=number["call"],
        task=Reference(number["task_origin"], number["task"]),
        operation=Operation(number["operation"]),
        kind=KindCode.ROBOT,
        criterion=Criterion.FINISH_TIME,
        attempt=1,
        depth=0,
        deadline_ms=number["deadline_ms"],
        from_station=number["from_station"],
        to_station=number["to_station"],
        car=car,
        wheelbase_mm=number["wheelbase_mm"],
    )
    ends = ((Handling.TAKE, "source"), (Handling.LEAVE, "sink"))
    return [Work(handling, Station.from_number(number[end]), car, call.wheelbase_mm, call) for handling, end in ends]
