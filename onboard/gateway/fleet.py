"""The fleet's own topics in JSON: tasks, calls with their bids, indicators, events with reason codes, fixed machines.

docs/mqtt.md describes every topic and key. Times are ISO 8601 in UTC; what the page tells of a call
(``onboard/web/picture``) is told here too, its times under the same names without ``_us``.
"""

from collections.abc import Iterator
from dataclasses import fields
from typing import Any

from onboard.contract.codes import KindCode, Operation, Reason, TaskPhase
from onboard.contract.messages import Message, Reference, TaskReport
from onboard.core.site import Segment, Site
from onboard.gateway.dialect import Json, timestamp
from onboard.gateway.edge import edge_of
from onboard.gateway.machines import TRAVELLERS
from onboard.gateway.settings import GatewaySettings
from onboard.gateway.state import reference_text
from onboard.history.calls import CallAnswered, CallHistory, CallOpened
from onboard.history.history import Fact
from onboard.history.lives import Beat
from onboard.history.places import PlaceTold
from onboard.history.system import SystemFact
from onboard.history.tasks import TaskTold
from onboard.trace.words import Words
from onboard.ways.site import way_site
from onboard.web.picture import LivePicture

#: Calls for a whole task; all others are for a part of one, or for room.
WHOLE = (Operation.PARK, Operation.RETRIEVE, Operation.TRANSPORT, Operation.REACH, Operation.MACHINE)
#: Words of a task's life (docs/mqtt.md) by its phase.
LIFE = {
    TaskPhase.OPEN: "called",
    TaskPhase.AWARDED: "awarded",
    TaskPhase.STARTED: "moving",
    TaskPhase.LOADED: "moving",
    TaskPhase.DONE: "done",
    TaskPhase.REFUSED: "refused",
    TaskPhase.FORFEITED: "given back",
}
#: Topic below the site's, and its content.
Told = tuple[str, Json]


class FleetTopics:
    """Feed it every message of the fleet bus in order; each call answers with what is to be told."""

    def __init__(self, site: Site, settings: GatewaySettings) -> None:
        self.site = site
        self.picture = LivePicture(site)
        self._epoch_us = settings.epoch_us
        self._words = Words(site)
        self._edge = edge_of(site)
        self._hour: int | None = None

    def set_epoch(self, epoch_us: int) -> None:
        """Wall time of loop time 0, in us since 1970: what timestamps are counted from."""
        self._epoch_us = epoch_us

    def feed(self, message: Message, now_us: int) -> Iterator[Told]:
        """Take up one message of the fleet bus; what it changes is yielded as publications."""
        yield from self.take(message, self.picture.history.feed(message, now_us), now_us)

    def take(self, message: Message, fact: Fact | None, now_us: int) -> Iterator[Told]:
        """Take up one message that the picture's history was fed with, and what it made of it."""
        self.picture.count_frame()
        self.picture.take(message, fact, now_us)
        match fact:
            case CallOpened():
                yield from self._on_call(fact.call, now_us)
            case CallAnswered() if fact.call is not None and fact.is_end:
                yield from self._on_end(fact.call, fact, now_us)
            case TaskTold() if fact.before is not fact.report.phase:
                yield from self._on_report(fact.report, now_us)
            case SystemFact():
                own = self._edge.told(fact, self.picture.history, now_us)
                if own is not None:
                    yield own[0], self._stamped({"at_us": now_us, **own[1]})
            case Beat() | PlaceTold() if not self._is_mobile(message.sender):
                yield from self._fixed(message.sender, now_us)
        reason = _reason(message)
        if reason is not None and not isinstance(fact, CallAnswered | TaskTold):
            yield "event", self._event(message, reason, now_us)

    def indicators(self, now_us: int) -> Json:
        """The indicators since the hour began, or since this began to listen."""
        hour = self._wall_us(now_us) // 3_600_000_000
        if hour != self._hour:
            if self._hour is not None:
                self.picture.indicators.begin(now_us)
            self._hour = hour
        return {"at": self._at(now_us), **self.picture.indicators.figures(now_us).to_json()}

    def task(self, reference: Reference, now_us: int) -> Json:
        """The JSON of one task: what it is, its phase, who has it."""
        view = self.picture.view
        body: Json = {"at": self._at(now_us), "task": reference_text(reference)}
        record = view.tasks.get(reference)
        if record is None:
            return body
        body |= {"what": record.operation.name.lower(), "phase": LIFE[record.phase], "calls": record.calls}
        if record.owner:
            body["owner"] = view.name(record.owner)
        call = next(
            (
                one
                for one in reversed(view.calls.values())
                if one.terms.task == reference and one.terms.operation in WHOLE
            ),
            None,
        )
        if call is not None:
            shown = self._call(call)
            body |= {key: shown[key] for key in ("car", "from", "to") if shown[key] is not None}
            promised: Json = next((bid["cost"] for bid in reversed(shown["bids"]) if bid["by"] == shown["winner"]), {})
            if "end_us" in promised:
                body["promised"] = self._at(promised["end_us"])
            if call.terms.operation is Operation.RETRIEVE:
                body |= self._stamped(self._edge.of_load(call.terms.car, self.picture.history, now_us))
        return body

    def place(self, number: int) -> str | None:
        """A station as the site's own topics name it."""
        return self._edge.place(number)

    def operation_of(self, reference: Reference) -> Operation | None:
        """What a task asks for, where its call was heard."""
        record = self.picture.view.tasks.get(reference)
        return record.operation if record is not None else None

    # --- inner works -------------------------------------------------------------------------------------------

    def _on_call(self, call: CallHistory, now_us: int) -> Iterator[Told]:
        yield "call", self._stamped({"at_us": now_us, **self._call(call)})
        if call.terms.operation in WHOLE:
            yield "task", self.task(call.terms.task, now_us)

    def _on_end(self, call: CallHistory, end: CallAnswered, now_us: int) -> Iterator[Told]:
        reason = end.award.reason
        body = self._call(call) | {"reason": reason.name, "code": int(reason)}
        yield "call", self._stamped({"at_us": now_us, **body})
        if call.terms.operation in WHOLE:
            yield "task", self.task(call.terms.task, now_us)

    def _on_report(self, report: TaskReport, now_us: int) -> Iterator[Told]:
        operation = self.operation_of(report.task)
        if operation is None or operation in WHOLE:
            extra = {"phase": LIFE[report.phase], "by": self.picture.view.name(report.sender)}
            yield "task", self.task(report.task, now_us) | extra | _coded(report.reason)

    def _call(self, record: CallHistory) -> Json:
        call = record.terms
        return self.picture.call(record) | {
            "task": reference_text(call.task),
            "car": reference_text(call.car) if call.car.number else None,
            "from": self.place(call.from_station),
            "to": self.place(call.to_station),
        }

    def _is_mobile(self, node: int) -> bool:
        machine = self.site.machines.get(node)
        return machine is None or machine.kind in TRAVELLERS

    def _fixed(self, node: int, now_us: int) -> Iterator[Told]:
        """Elevators, compartments and all others that do not travel: state, and the floor of an elevator."""
        machine, view = self.site.machines[node], self.picture.view
        state = view.history.lives.states.get(node)
        body: Json = {"kind": machine.kind.name.lower(), "state": state.name.lower() if state is not None else "silent"}
        if machine.kind is KindCode.LIFT:
            segment = view.history.places.by_node[node].segment
            shaft = way_site(self.site).tracks.get(segment.track)
            floors = shaft.joins if shaft is not None else ()
            if 1 <= segment.index <= len(floors):
                body["floor"] = floors[segment.index - 1].track
        yield f"machine/{machine.name}", body

    def _event(self, message: Message, reason: Reason, now_us: int) -> Json:
        body: Json = {
            "at": self._at(now_us),
            "event": type(message).__name__,
            "by": self.picture.view.name(message.sender),
        }
        names = {field.name for field in fields(message)}
        if {"track", "index"} <= names:
            body["segment"] = str(Segment(_number(message, "track"), _number(message, "index")))
        for name in ("blocker", "count"):
            if name in names:
                body[name] = _number(message, name)
        if body.get("blocker"):
            body["blocker"] = self.picture.view.name(body["blocker"])
        return body | _coded(reason) | {"text": self._words.message(message)}

    def _stamped(self, value: Any) -> Any:
        """The same with every time of the log as a time stamp, ``x_us`` as ``x``."""
        if isinstance(value, dict):
            return {
                key.removesuffix("_us"): self._at(one)
                if key.endswith("_us") and one is not None
                else self._stamped(one)
                for key, one in value.items()
            }
        if isinstance(value, list):
            return [self._stamped(one) for one in value]
        return value

    def _wall_us(self, time_us: int) -> int:
        return self._epoch_us + time_us

    def _at(self, time_us: int) -> str:
        return timestamp(self._wall_us(time_us))


def _coded(reason: Reason) -> Json:
    """A reason by its name and its number on the bus; nothing where there is none."""
    return {"reason": reason.name, "code": int(reason)} if reason is not Reason.NONE else {}


def _reason(message: Message) -> Reason | None:
    found = getattr(message, "reason", None)
    return found if isinstance(found, Reason) else None


def _number(message: Message, name: str) -> int:
    found = getattr(message, name)
    assert isinstance(found, int)
    return found
