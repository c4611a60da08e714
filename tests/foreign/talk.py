"""What a robot says and hears on the fleet bus: chapters 1 to 6, 10 and 12 of docs/protocol.md.

It imports nothing of ours (``test_park.py`` proves that). It knows as much of a fleet as it needs on such a site: one
compartment, which is the steward, and no other robot. Pure: frames and times in, frames out.
"""

from binascii import crc_hqx
from dataclasses import dataclass, field
from zlib import crc32

from tests.foreign.rights import Key, Rights
from tests.foreign.site import Alley, delay_us
from tests.foreign.words import FOLDER, Signals, Word, encode, joined
from tests.foreign.work import Call, Program, Step, Task, least_us, solve
from tests.foreign.wrong import Drops, Stops

#: Bus ("fleet", "device"), identifier, bytes.
Frame = tuple[str, int, bytes]
_T_SLEW, _T_FAR, _T_SHARE, _T_TELL, _T_APART, _T_PLACE = 2_000, 100_000, 250_000, 100_000, 300_000, 8_000_000
_OUTSIDE = 65534


def contract() -> int:
    """Chapter 16."""
    lines = (FOLDER / "fleet.dbc").read_text(encoding="utf-8").split("\n")
    return 128 | crc32("\n".join(line for line in lines if line.startswith(("BO_ ", " SG_ "))).encode()) & 0x7F


@dataclass
class Talk:
    """One robot in its first life, but for what it does. Times are bus time in us."""

    alley: Alley
    boot: int = 1
    contract: int = field(default_factory=contract)
    frames: list[Frame] = field(default_factory=list)
    words: list[tuple[str, Signals]] = field(default_factory=list)
    offset_us: int | None = None
    far_us: int | None = None
    beat_due_us: int = 0
    beat_us: int = -_T_APART
    started_us: int = 0
    answered: set[int] = field(default_factory=set)
    asked_us: int = 0
    quiet_until_us: int = 0
    apart: int = 0
    askers: set[int] = field(default_factory=set)
    boots: dict[int, int] = field(default_factory=dict)
    drive: Signals | None = None
    shuttle: Signals | None = None
    sets: dict[tuple[int, int], dict[str, Signals]] = field(default_factory=dict)
    calls: dict[tuple[int, int], Call] = field(default_factory=dict)
    #: Station, custodian, version, wheelbase.
    cars: dict[Task, tuple[int, int, int, int]] = field(default_factory=dict)
    done: list[Task] = field(default_factory=list)
    begun: Step | None = None
    actions: list[str] = field(default_factory=list)
    order: Signals | None = None
    shuttle_order: Signals | None = None
    order_due_us: int | None = None
    said: tuple[int, bool, int] = (0, False, 0)
    now_us: int = 0

    def __post_init__(self) -> None:
        self.program = Program(self.alley)
        self.rights = Rights(self.alley.node, self._first_holder, self.say)
        self.drops, self.stops = Drops(), Stops()

    def _first_holder(self, key: Key) -> int:
        if key[0] in ("CAR", "TASK"):
            return key[1] >> 16
        is_home = key == self._segment(self.alley.home)
        return self.alley.node if is_home else self.alley.steward

    def _segment(self, index: int) -> Key:
        return "SEGMENT", self.alley.track << 8 | index

    # --- frames in and out ---------------------------------------------------------------------------------------

    def start(self) -> list[Frame]:
        """Power on: the own devices are asked how they stand."""
        self.tell("StateRequest", {})
        return self._out()

    def next_due(self) -> int | None:
        """When ``wake`` is wanted, own clock."""
        if self.offset_us is None:
            return None
        times = [self.beat_due_us, self.order_due_us, self.rights.next_due(), self.drops.next_due(self.alley.beat_us)]
        times += [one.due_us for one in self.calls.values()]
        if self.askers:
            times.append(self.quiet_until_us)
        if not self.rights.is_synced:
            times.append(max(self.asked_us + 500_000, self.started_us + self.alley.beat_us))
        if self.program.steps and not self.stops.is_held(self.now_us):
            step = self.program.steps[0]
            times.append(step.end_us if step.action == "STAND" else step.end_us + 2_000_000)
        return max(self.now_us, min(one for one in times if one is not None)) - self.offset_us

    def say(self, name: str, signals: Signals) -> None:
        """On the fleet bus, with what else is said now."""
        self.words.append((name, signals))
        if name in ("ItineraryHead", "CarAt"):
            # J2: a word that changes digests.
            self.beat_due_us = min(self.beat_due_us, max(self.now_us + _T_TELL, self.beat_us + _T_APART))

    def tell(self, name: str, signals: Signals) -> None:
        """To the own devices."""
        self.frames.append(("device", *encode("device", self.alley.node, name, signals)))

    def _out(self) -> list[Frame]:
        for name, signals in joined(self.words):
            self.frames.append(("fleet", *encode("fleet", self.alley.node, name, signals)))
        found, self.words, self.frames = self.frames, [], []
        return found

    # --- time and presence ---------------------------------------------------------------------------------------

    def _on_time(self, word: Word, local_us: int) -> None:
        told_us = word.signals["bus_time_us"]
        if self.offset_us is None:
            self.offset_us = told_us - local_us
            self._begin(told_us)
            return
        error_us = told_us - local_us - self.offset_us
        if abs(error_us) <= _T_FAR:
            self.far_us = None
            self.offset_us += max(-_T_SLEW, min(_T_SLEW, error_us))
        elif self.far_us is not None and abs(error_us - self.far_us) <= 20_000:
            self.offset_us, self.far_us = self.offset_us + error_us, None
        else:
            self.far_us = error_us

    def _begin(self, now_us: int) -> None:
        """J1, R1: a first life."""
        self.now_us = self.started_us = self.asked_us = now_us
        self.quiet_until_us = now_us + _T_SHARE
        self.rights.asked = set(self.alley.nodes) - {self.alley.node}
        self._beat()
        self.rights.statements()
        self.say("SyncRequest", {"whom": 0, "boot_before": 0})
        self.tell("StateRequest", {})

    @property
    def state(self) -> str:
        """J5, and what it does."""
        if not self.program.version:
            return "STARTING"
        if self.stops.is_held(self.now_us):
            return "OBSTACLE"
        return "WORKING" if self.program.steps else "IDLE"

    def digest(self) -> int:
        """J4."""
        words = [self.alley.node << 8 | self.program.version] if self.program.version else []
        for (origin, number), (station, *_) in sorted(self.cars.items()):
            words += [] if station == _OUTSIDE else [origin << 16 | number, station]
        return crc_hqx(b"".join(word.to_bytes(4, "big") for word in words), 0xFFFF)

    def _beat(self) -> None:
        mine = {"contract": self.contract, "site_digest": self.alley.digest, "mirror_digest": self.digest()}
        self.say("Heartbeat", {**mine, "boot": self.boot, "kind": "ROBOT", "state": self.state, "epoch": 0})
        if self.stops.since_us:
            why = {"reason": "EMERGENCY_STOP", "cause": min(self.stops.since_us), "needs_person": 0}
            self.say("Halted", {"machine": self.alley.node, **why, "boot": self.boot})
        nodes, beat_us = sorted(self.alley.nodes), self.alley.beat_us
        phase_us = nodes.index(self.alley.node) * beat_us // len(nodes)
        self.beat_us = self.now_us
        self.beat_due_us = self.now_us + beat_us - (self.now_us - phase_us) % beat_us

    def _answer(self) -> None:
        """R3: all that I vouch for."""
        if not self.askers or self.now_us < self.quiet_until_us:
            return
        for name, signals in self.program.words:
            self.say(name, signals)
        if self.drive is not None:
            self._place()
        for step in self.program.works():
            if step.takes and step.call is not None:
                self._report(step.call.task, "AWARDED", step.station)
        for car, (station, custodian, version, wheelbase) in self.cars.items():
            if custodian == self.alley.node:
                self._car_at(car, station, version, wheelbase)
        self.rights.statements()
        whom = next(iter(self.askers)) if len(self.askers) == 1 else 0
        self.say("SyncDone", {"whom": whom, "boot": self.boot})
        self.askers.clear()
        self.quiet_until_us = self.now_us + _T_SHARE

    # --- what is heard -------------------------------------------------------------------------------------------

    def _hear(self, word: Word) -> None:
        given = word.signals
        match word.name:
            case "EmergencyStop":
                self.stops.since_us[word.sender] = self.beat_due_us = self.now_us
            case "Go":
                self.stops.go(given["stopper"], self.now_us)
            case "TokenRequest" if self.stops.is_held(self.now_us):
                pass
            case "Heartbeat":
                self.boots[word.sender] = given["boot"]
                self._compare(word)
            case "SyncRequest" if given["whom"] in (0, self.alley.node):
                self.askers.add(word.sender)
                if not given["whom"] and word.sender in self.boots:
                    # R5: it was started again.
                    self.rights.asked.add(word.sender)
                    self.say("SyncRequest", {"whom": word.sender, "boot_before": self.boots[word.sender]})
            case "SyncDone" if given["whom"] in (0, self.alley.node):
                self.answered.add(word.sender)
                self.rights.asked.discard(word.sender)
            case "Call" | "CallTerms" | "CallLoad" | "CallParent":
                self._on_call(word)
            case "Bid":
                self._on_bid(word)
            case "Award":
                self._on_award(word)
            case "CarAt":
                self._on_car(word)
            case name if name.startswith("Token") and "token" in given:
                self.rights.hear(word, self.now_us)

    def _compare(self, word: Word) -> None:
        """R6, without the turns of a larger fleet."""
        differs = word.signals["mirror_digest"] != self.digest() and self.program.version
        self.apart = self.apart + 1 if differs else 0
        if self.apart in (1, 2, 3) or (self.apart and self.apart % 8 == 0):
            self.rights.asked.add(word.sender)
            self.say("SyncRequest", {"whom": word.sender, "boot_before": 0})

    def _on_car(self, word: Word) -> None:
        """C2; the version is a serial number."""
        given = word.signals
        car = given["car_origin"], given["car_number"]
        known = self.cars.get(car)
        is_mine = ("CAR", car[0] << 16 | car[1]) in self.rights.held
        if not is_mine and (known is None or 0 <= (given["version"] - known[2]) & 0xFFFF < 0x8000):
            self.cars[car] = (given["station"], word.sender, given["version"], given["wheelbase_mm"])

    def _on_call(self, word: Word) -> None:
        key = word.sender, word.signals["call"]
        parts = self.sets.setdefault(key, {})
        parts[word.name] = word.signals
        if key in self.calls or not {"Call", "CallTerms", "CallLoad"} <= set(parts):
            return
        del self.sets[key]
        head, terms, load, parent = parts["Call"], parts["CallTerms"], parts["CallLoad"], parts.get("CallParent")
        can = head["operation"] in ("PARK", "RETRIEVE") and head["criterion"] == "FINISH_TIME" and not head["depth"]
        if head["kind"] not in ("ANY", "ROBOT") or not can:
            return
        deadline_us = self._near_us(terms["deadline_ms"])
        task = head["task_origin"], head["task_number"]
        self.calls = {one: call for one, call in self.calls.items() if call.task != task or one[0] != word.sender}
        ready_us = deadline_us + parent["ready_ms"] * 1000 if parent is not None and parent["ready_ms"] else 0
        car = load["car_origin"], load["car_number"]
        ends = terms["from_station"], load["to_station"]
        times = deadline_us, terms["deadline_ms"]
        call = Call(*key, task, head["operation"], *times, *ends, car, load["wheelbase_mm"], self.now_us, ready_us)
        self.calls[key] = call
        if self._solve(call):
            call.floor_us = least_us(self.alley, call)
            wait_us = delay_us(call.cost_us - call.floor_us, self.alley.bid_delay_us, self.alley.bid_half_us)
            begin_us, round_us = self.alley.slot_us()
            call.due_us = self.now_us + wait_us // round_us * round_us + begin_us

    def _near_us(self, bus_ms: int) -> int:
        """F6."""
        now_ms = self.now_us // 1000
        return (now_ms + (bus_ms - now_ms + 2**31) % 2**32 - 2**31) * 1000

    def _solve(self, call: Call) -> bool:
        taken = {station for station, *_ in self.cars.values()} | {step.station for step in self.program.works()}
        free = [station for station in self.alley.places if station not in taken]
        _, place, from_us = self.program.free_from(self._here, self.now_us)
        found = solve(self.alley, call, place, from_us, free)
        if found is None:
            return False
        call.steps, call.cost_us = found
        return True

    def _on_bid(self, word: Word) -> None:
        call = self.calls.get((word.signals["initiator"], word.signals["call"]))
        one = word.signals["cost"], word.sender
        if call is not None and (call.best is None or one < call.best):
            call.best = one

    def _bid(self, call: Call) -> None:
        """B4 to B6, B8."""
        call.due_us = None
        is_ready = self.rights.is_synced and self.program.version and self.far_us is None
        is_ready = is_ready and not self.stops.is_held(self.now_us)
        if not is_ready or self.now_us >= call.deadline_us - 2 * self.alley.guard_us or not self._solve(call):
            return
        mine = -(-call.cost_us // 1000), self.alley.node
        if call.best is not None and call.best < mine:
            return
        call.best, call.has_bid = mine, True
        self.say("Bid", {"initiator": call.initiator, "call": call.number, "cost": mine[0], "itinerary_version": 0})

    def _on_award(self, word: Word) -> None:
        """B9, U1, U3, U4."""
        given = word.signals
        task = given["task_origin"], given["task_number"]
        if given["winner"] != self.alley.node or given["result"] != "AWARDED":
            self._lose(word, task)
            return
        call = self.calls.get((word.sender, given["call"]))
        in_hand = [step for step in self.program.works() if step.call is not None and step.call.task == task]
        if in_hand:
            self._report(task, "AWARDED" if in_hand[0].takes else "LOADED", 0)
        elif task in self.done:
            self._report(task, "DONE", 0)
        elif call is None or not call.has_bid or not self._solve(call):
            self._report(task, "FORFEITED", 0, "JOURNAL_LOST" if call is None else "IMPOSSIBLE")
        else:
            kept, _, _ = self.program.free_from(self._here, self.now_us)
            self.program.steps = [*kept, *call.steps]
            self.program.stamp = call.deadline_ms, call.initiator, call.number & 0xFF
            self.rights.journal.append(("won", task))
            self._publish()
            self._report(task, "AWARDED", next(step.station for step in reversed(call.steps) if step.call is not None))

    def _lose(self, word: Word, task: Task) -> None:
        """U6, B7: its initiator takes it back, or gives it to another; without work left the robot goes home."""
        given = word.signals
        self.calls.pop((word.sender, given["call"]), None)
        mine = [step for step in self.program.works() if step.call is not None and step.call.task == task]
        is_newer = given["result"] == "AWARDED" and given["task_version"] > 1
        is_taken = bool(mine) and mine[0].takes and mine[0].call is not None and mine[0].call.initiator == word.sender
        if not is_taken or not (is_newer or given["result"] in ("REJECTED", "WITHDRAWN")):
            return
        others = [step.call for step in self.program.works() if step.takes and step.call is not None]
        first = self.program.steps[:1] if self.program.steps[0].action == "TRAVEL" else []
        self.program.steps, self.begun = first, first[0] if first and self.begun is first[0] else None
        for call in others:
            if call.task != task and self._solve(call):
                kept, _, _ = self.program.free_from(self._here, self.now_us)
                self.program.steps = [*kept, *call.steps]
        if not self.program.works():
            self.program.go_home(self._here, self.now_us)
        self.actions = []
        self.rights.wanted.clear()
        self._publish()

    # --- words ---------------------------------------------------------------------------------------------------

    def _report(self, task: Task, phase: str, station: int, reason: str = "NONE") -> None:
        signals = {"task_origin": task[0], "task_number": task[1], "phase": phase, "station": station}
        self.say("TaskReport", {**signals, "reason": reason})

    def _car_at(self, car: Task, station: int, version: int, wheelbase_mm: int) -> None:
        signals = {"car_origin": car[0], "car_number": car[1], "station": station, "version": version}
        word = "CarAt", {**signals, "wheelbase_mm": wheelbase_mm // 10 * 10}
        self.say(*word)
        self.rights.before_grant["CAR", car[0] << 16 | car[1]] = word

    def _publish(self) -> None:
        for name, signals in self.program.publish(self._here, self.now_us):
            self.say(name, signals)
        self.rights.version = self.program.version

    def _place(self) -> None:
        assert self.drive is not None
        index = self._here
        offset_mm = self.drive["position_mm"] - (index - 1) * self.alley.pitch_mm
        where = {"track": self.alley.track, "index": index, "offset_mm": offset_mm}
        plan = {"itinerary_version": self.program.version, "leg": self.program.leg}
        self.say("Progress", {**plan, **where, "speed_mm_s": self.drive["speed_mm_s"]})
        self.said = index, self.drive["mode"] != "STANDING", self.now_us

    def _tell_place(self, state: Signals) -> None:
        """P10."""
        index, was_moving, said_us = self.said
        stops = state["mode"] == "STANDING" and was_moving
        if stops or (self._here != index and (not was_moving or self.now_us - said_us >= _T_PLACE)):
            self._place()

    @property
    def _here(self) -> int:
        return self.alley.home if self.drive is None else self.alley.index_at(self.drive["position_mm"])
