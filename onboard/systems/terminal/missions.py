"""Missions at a desk: orders become transports, one box each (rows M04 to M06, M23); kept in the journal."""

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from onboard.contract.codes import TaskPhase
from onboard.contract.messages import NO_REFERENCE, Reference
from onboard.contract.terminal import Verb
from onboard.contract.terminal_device import MissionKey
from onboard.core.journal_records import Entry, records_in
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.records import OrdersRecord
from onboard.systems.terminal.site import EntityKind, Terminal
from onboard.work.order_life import OrderEvent, OrderState, WorkOrder

#: Tasks from outside that are remembered once they are over.
MOST_OVER = 64
#: Numbers at the beginning of a task's row in the journal.
TASK_NUMBERS = 7
#: Numbers of missions that are remembered; their 8 bits come round after twice as many.
KNOWN = 127


@dataclass
class MissionOrder:
    """One mission: ``left`` boxes of ``type`` from ``source``, or those ``named``; ``before_us`` 0 for no date."""

    number: int
    target: int
    left: int = 0
    type: str = ""
    source: int = 0
    named: list[int] = field(default_factory=list)
    before_us: int = 0
    urgent: bool = False
    #: The task's name where it was ordered from outside: one box then.
    task: Reference | None = None

    @property
    def rank(self) -> tuple[bool, int, int]:
        """Urgent ones first, then by their dates, then as they came."""
        return not self.urgent, self.before_us or 1 << 62, self.number


@dataclass
class Transport(WorkOrder):
    """One box of a mission under a task's name; ``type`` and ``source`` where any of that type from there will do."""

    mission: int
    box: int
    target: int
    before_us: int
    urgent: bool
    type: str = ""
    source: int = 0


@dataclass
class MissionBook:
    """A desk's missions. What a mission still lacks is not called for before a robot is about to be free (M27)."""

    site: Terminal
    node_id: int
    missions: dict[int, MissionOrder] = field(default_factory=dict)
    open: dict[Reference, Transport] = field(default_factory=dict)
    done: int = 0
    last_task: int = 0
    #: Tasks from outside that are done, the newest so many: who asks for one again is told so.
    over: deque[Reference] = field(default_factory=lambda: deque(maxlen=MOST_OVER))
    #: The newest missions that were taken, so that one said again is not carried out again.
    taken: deque[int] = field(default_factory=lambda: deque(maxlen=KNOWN))
    _typed: dict[int, MissionOrder] = field(default_factory=dict)

    def key(self, key: MissionKey) -> MissionOrder | None:
        """What an operator types; the mission that it completes, or None. Unknown types and boxes are passed over."""
        if key.mission in self.taken:
            return None
        order = self._typed.setdefault(
            key.mission,
            MissionOrder(key.mission, key.target, before_us=key.before_s * 1_000_000, urgent=key.urgent),
        )
        if key.verb is Verb.TRANSHIP:
            if 1 <= key.what <= len(self.site.boxes) and key.what not in order.named:
                order.named.append(key.what)
            return None
        if key.verb is Verb.END and len(order.named) < key.count:
            return None
        del self._typed[key.mission]
        if key.verb is Verb.LOAD:
            types = types_of(self.site)
            if key.what >= len(types) or not (self._is_place(key.source) or self._is_area(key.source)):
                return None
            order.left, order.type, order.source = key.count, types[key.what], key.source
        if key.mission in self.missions or not (order.left or order.named) or not self._is_place(key.target):
            return None
        self.missions[key.mission] = order
        self.taken.append(key.mission)
        return order

    def answer(self, key: MissionKey) -> bool | None:
        """Whether what was typed is a mission that will be carried out; None while more of it is to come."""
        if key.mission in self.taken:
            return True
        return None if key.verb is Verb.TRANSHIP or key.mission in self._typed else False

    def _is_place(self, number: int) -> bool:
        entity = self.site.entities.get(number)
        return entity is not None and entity.kind is EntityKind.STATION

    def _is_area(self, number: int) -> bool:
        entity = self.site.entities.get(number)
        return entity is not None and entity.kind is EntityKind.AREA

    def next(self, mirror: TerminalMirror, taken: set[int]) -> Transport | None:
        """The transport to be called for next: the best mission with an available box (nothing above, M23)."""
        for order in sorted(self.missions.values(), key=lambda one: one.rank):
            box = self._available(order, mirror, taken)
            if box is None:
                continue
            if order.named:
                order.named.remove(box)
            else:
                order.left -= 1
            if not order.named and not order.left:
                del self.missions[order.number]
            task = order.task
            if task is None:
                self.last_task += 1
                task = Reference(self.node_id, self.last_task)
            terms = order.target, order.before_us, order.urgent, order.type, order.source
            transport = self.open[task] = Transport(task, order.number, box, *terms)
            transport.meet(OrderEvent.CALL)
            return transport
        return None

    def _available(self, order: MissionOrder, mirror: TerminalMirror, taken: set[int]) -> int | None:
        """A box with nothing above but what robots already plan to take away."""
        if order.named:
            boxes = list(order.named)
        else:
            stations = self.site.stations_in(order.source)
            boxes = [
                box
                for station in stations
                for box in reversed(mirror.standing.get(station, ()))
                if self.site.boxes[box - 1].type == order.type and station != order.target
            ]
        for box in boxes:
            station = mirror.station_of(box)
            if not station or station == order.target or box in taken or mirror.in_plans(box) is not None:
                continue
            if mirror.is_free(box):
                return box
        return None

    def buried(self, mirror: TerminalMirror) -> list[tuple[int, int]]:
        """(box, box above it) of boxes ordered by name that lie under one that nobody has ordered away.

        Where boxes should best stand, and what to move aside for another, is out of scope (row M08): people order it.
        """
        ordered = {box for order in self.missions.values() for box in order.named}
        ordered |= {transport.box for transport in self.open.values()}
        found = []
        for box in sorted(ordered):
            above = [one for one in mirror.above(box) if one not in ordered and mirror.in_plans(one) is None]
            if above:
                found.append((box, above[-1]))
        return found

    @property
    def won(self) -> dict[Reference, int]:
        """Who has which task in hand."""
        return {one.task: one.winner for one in self.open.values() if one.state is OrderState.IN_HAND}

    def goes_to(self, task: Reference, winner: int) -> bool:
        """Somebody has a task; False for one that was not called for."""
        transport = self.open.get(task)
        if transport is None or not transport.meet(OrderEvent.WON):
            return False
        transport.winner = winner
        return True

    def give_back(self, task: Reference, event: OrderEvent) -> None:
        """Nobody does it: its box, or another of its type, is a mission of its own again."""
        transport = self.open.get(task)
        if transport is None or not transport.meet(event):
            return
        del self.open[task]
        order = self.missions.setdefault(
            transport.mission,
            MissionOrder(
                transport.mission,
                transport.target,
                type=transport.type,
                source=transport.source,
                before_us=transport.before_us,
                urgent=transport.urgent,
            ),
        )
        order.task = None if task.origin == self.node_id else task
        if order.type:
            order.left += 1
        else:
            order.named.append(transport.box)

    def arrived(self, mirror: TerminalMirror) -> list[tuple[int, Reference]]:
        """Boxes ordered by name that stand where they are to come, and their tasks, or NO_REFERENCE.

        Whoever brought them: nothing is left to do.
        """
        found = []
        for order in list(self.missions.values()):
            there = [box for box in order.named if mirror.station_of(box) == order.target]
            order.named = [box for box in order.named if box not in there]
            found += [(box, order.task or NO_REFERENCE) for box in there]
            if not order.named and not order.left:
                del self.missions[order.number]
        self.done += len(found)
        self.over.extend(task for _, task in found if task != NO_REFERENCE)
        return found

    def finish(self, task: Reference) -> bool:
        """A transport is over; True where it was open."""
        transport = self.open.get(task)
        if transport is None or not transport.meet(OrderEvent.CARRIED_OUT):
            return False
        del self.open[task]
        self.done += 1
        if task.origin != self.node_id:
            self.over.append(task)
        return True

    # --- from outside --------------------------------------------------------------------------------------------

    def phase_of(self, task: Reference) -> TaskPhase | None:
        """How a task from outside stands; None for one that is not known."""
        if task in self.over:
            return TaskPhase.DONE
        if task in self.open:
            return TaskPhase.AWARDED if self.open[task].state is OrderState.IN_HAND else TaskPhase.OPEN
        return TaskPhase.OPEN if any(one.task == task for one in self.missions.values()) else None

    def may_order(self, box: int, target: int) -> bool:
        """Whether there are such a box and such a station, and nobody has ordered that box yet."""
        place = self.site.entities.get(target)
        ordered = {one for order in self.missions.values() for one in order.named}
        ordered |= {transport.box for transport in self.open.values()}
        is_known = 1 <= box <= len(self.site.boxes) and place is not None and place.kind is EntityKind.STATION
        return is_known and box not in ordered

    def order(self, task: Reference, box: int, target: int, before_us: int, *, urgent: bool) -> None:
        """One box for one station, as a mission of its own; its number is none that a keyboard has."""
        number = task.origin << 16 | task.number
        self.missions[number] = MissionOrder(number, target, named=[box], before_us=before_us, urgent=urgent, task=task)

    # --- journal -----------------------------------------------------------------------------------------------

    def record(self) -> OrdersRecord:
        """All that is not over, as one entry: the newest counts."""
        missions = ";".join(
            f"{one.number},{one.target},{one.left},{one.type},{one.source},{one.before_us},{int(one.urgent)},"
            + "+".join(str(box) for box in one.named)
            + (f",{one.task.origin},{one.task.number}" if one.task is not None else "")
            for one in self.missions.values()
        )
        tasks = ";".join(
            f"{one.task.number},{one.mission},{one.box},{one.target},{one.before_us},{int(one.urgent)},"
            f"{one.winner},{one.task.origin},{one.type},{one.source}"
            for one in self.open.values()
        )
        over = ";".join(f"{one.origin},{one.number}" for one in self.over)
        taken = ";".join(str(number) for number in self.taken)
        return OrdersRecord(missions, tasks, self.last_task, self.done, over, taken)

    def replay(self, entries: Iterable[Entry]) -> None:
        """What the newest entry says."""
        newest = next(iter([*records_in(entries, OrdersRecord)][-1:]), None)
        if newest is None:
            return
        self.last_task, self.done = newest.last, newest.done
        for row in newest.over.split(";"):
            if row:
                self.over.append(Reference(*(int(one) for one in row.split(","))))
        self.taken.extend(int(number) for number in newest.taken.split(";") if number)
        for row in newest.missions.split(";"):
            if row:
                number, target, left, kind, source, before, is_urgent, named, *name = row.split(",")
                boxes = [int(box) for box in named.split("+") if box]
                self.missions[int(number)] = MissionOrder(
                    int(number), int(target), int(left), kind, int(source), boxes, int(before), is_urgent == "1"
                )
                self.missions[int(number)].task = Reference(int(name[0]), int(name[1])) if name else None
        for row in newest.tasks.split(";"):
            if row:
                self._replay_task(row.split(","))

    def _replay_task(self, row: list[str]) -> None:
        """One that was called for. Version 0.1 wrote neither who named it, which was the desk, nor type and source."""
        number, mission, box, to, before_us, urgent, winner = (int(one) for one in row[:TASK_NUMBERS])
        origin, kind, source = (*row[TASK_NUMBERS:], *(str(self.node_id), "", "0")[len(row) - TASK_NUMBERS :])
        task = Reference(int(origin), number)
        one = self.open[task] = Transport(task, mission, box, to, before_us, bool(urgent), kind, int(source))
        one.meet(OrderEvent.CALL)
        if winner:
            self.goes_to(task, winner)


def types_of(site: Terminal) -> list[str]:
    """The site's types of boxes, as a desk's keyboard numbers them."""
    return list(dict.fromkeys(box.type for box in site.boxes))
