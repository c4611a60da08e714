"""A robot of a site with one alley, written from docs/protocol.md, docs/site-file.md and the DBC files alone.

It imports nothing of ours (``test_park.py`` proves that). It knows as much of a fleet as it needs on such a site: one
compartment, which is the steward, and no other robot. Pure: frames and times in, frames out.
"""

from dataclasses import dataclass

from tests.foreign.rights import Key
from tests.foreign.site import side_of
from tests.foreign.talk import Frame, Talk
from tests.foreign.words import Word, decode, singles
from tests.foreign.work import Step
from tests.foreign.wrong import fault_of

_ABOARD = 65535
_RETRACTED = ("REACH", "GRIP", "RETRACT"), ("REACH", "RELEASE", "RETRACT")
_AFTER = {"REACH": "REACHED", "GRIP": "REACHED", "RELEASE": "REACHED", "RETRACT": "HOME"}


@dataclass
class Robot(Talk):
    """What it does with drive and shuttle (chapters 7, 8, 10). ``receive`` and ``wake`` take times of its own clock."""

    def receive(self, bus: str, number: int, data: bytes, local_us: int) -> list[Frame]:
        """A frame of either bus."""
        fault = fault_of(self.alley.nodes, self.alley.node, number, data) if bus == "fleet" else ""
        if fault:
            return self.drop(fault, local_us)
        word = decode(bus, number, data)
        if word is None or (bus == "fleet" and word.sender == self.alley.node):
            return []
        if word.name == "BusTime":
            self._on_time(word, local_us)
        if bus == "device":
            self._on_device(word)
        if self.offset_us is None:
            return self._out()
        self.now_us = local_us + self.offset_us
        if word.name == "DriveState":
            self._tell_place(word.signals)
        if bus == "fleet":
            for one in singles(word):
                self._hear(one)
        return self._go_on()

    def drop(self, reason: str, local_us: int) -> list[Frame]:
        """A frame that does not count (duty F3)."""
        self.drops.add(reason)
        return self.wake(local_us)

    def wake(self, local_us: int) -> list[Frame]:
        """Something is due."""
        if self.offset_us is None:
            return []
        self.now_us = local_us + self.offset_us
        return self._go_on()

    # --- what is done --------------------------------------------------------------------------------------------

    def _on_device(self, word: Word) -> None:
        if word.name == "DriveState":
            if self.drive is None:
                self.order = {"sequence": word.signals["sequence"], "target_mm": word.signals["position_mm"]}
            self.drive = word.signals
        elif word.name == "ShuttleState":
            if self.shuttle is None:
                self.shuttle_order = {"sequence": word.signals["sequence"]}
            self.shuttle = word.signals

    def _go_on(self) -> list[Frame]:
        """All that is due, in an order in which nothing waits for what comes behind it."""
        self._sync()
        for call in list(self.calls.values()):
            if call.due_us is not None and call.due_us <= self.now_us:
                self._bid(call)
        if not self.program.version and self.drive is not None and self.shuttle is not None:
            self.program.stamp = 0, self.alley.node, 0
            self._place()
            self._publish()
        if self.stops.is_held(self.now_us):
            self.order_due_us = None
            self.rights.wanted.clear()
        elif self.rights.is_synced and self.program.version:
            self._work()
        self.rights.wake(self.now_us)
        self.words += self.drops.due(self.alley.beat_us, self.now_us)
        self._answer()
        if self.beat_due_us <= self.now_us:
            self._beat()
        self.calls = {key: one for key, one in self.calls.items() if self.now_us < one.deadline_us + 60_000_000}
        return self._out()

    def _sync(self) -> None:
        """R2."""
        others = set(self.alley.nodes) - {self.alley.node}
        if self.rights.is_synced:
            return
        if self.answered >= others and self.now_us >= self.started_us + self.alley.beat_us:
            self.rights.is_synced = True
        elif self.now_us >= self.asked_us + 500_000 and self.now_us >= self.started_us + self.alley.beat_us:
            self.asked_us = self.now_us
            for node in others - self.answered:
                self.say("SyncRequest", {"whom": node, "boot_before": 0})

    def _work(self) -> None:
        for _ in range(len(self.program.steps) + 1):
            if not self.program.steps:
                self._stand()
                return
            step = self.program.steps[0]
            if self.begun is not step:
                self.begun = step
                self._begin_step(step)
            over = {"TRAVEL": self._travel, "STAND": self._wait, "WORK": self._handle}[step.action](step)
            if not over:
                if self.now_us >= step.end_us + 2_000_000:
                    self._late(step, self.now_us + 2_000_000 - step.end_us)
                return
            self.program.steps.pop(0)
            late_us = self.now_us - (self.program.steps[0].begin_us if self.program.steps else step.end_us)
            if self.program.steps and abs(late_us) > 500_000:
                self.program.shift(late_us)
                self._publish()

    def _late(self, step: Step, by_us: int) -> None:
        """P9: it lasts longer, and what follows comes later."""
        self.program.shift(by_us)
        first = self.program.steps[0]
        self.program.steps[0] = self.begun = Step(**{**vars(first), "begin_us": step.begin_us})
        self._publish()

    def _begin_step(self, step: Step) -> None:
        if step.action == "WORK":
            self.actions = list(_RETRACTED[0 if step.takes else 1])
            if step.takes and step.call is not None:
                self._report(step.call.task, "STARTED", step.station)

    def _wait(self, step: Step) -> bool:
        self._stand()
        return self.now_us >= step.end_us

    def _stand(self) -> None:
        self.order_due_us = None
        self._give_back(self._body())

    def _body(self) -> list[int]:
        assert self.drive is not None
        return self.alley.occupied(self.drive["position_mm"])

    def _travel(self, step: Step) -> bool:
        """K2, K14, K15: as far as an unbroken line of held segments leads."""
        assert self.drive is not None and self.order is not None and self.shuttle is not None
        target_mm = (step.end - 1) * self.alley.pitch_mm
        is_there = self.drive["mode"] == "STANDING" and abs(self.drive["position_mm"] - target_mm) <= 5
        if is_there and self.drive["sequence"] == self.order["sequence"]:
            self._stand()
            return True
        way = 1 if step.end >= self._here else -1
        ahead = list(range(self._here, step.end + way, way))
        needed = [*self._body(), *ahead[: self.alley.soon + 4]]
        for index in dict.fromkeys(needed):
            self.rights.want(self._segment(index), self.now_us)
        held = [index for index in self._body() if self.rights.holds(self._segment(index))]
        if held != self._body() or self.shuttle["mode"] != "HOME":
            self.order_due_us = None
            return False
        reach = self._here
        for index in ahead:
            if not self.rights.holds(self._segment(index)):
                break
            reach = index
        self._drive_to((reach - 1) * self.alley.pitch_mm)
        self._give_back([*self._body(), *ahead])
        return False

    def _drive_to(self, target_mm: int) -> None:
        assert self.order is not None
        is_new = target_mm != self.order["target_mm"]
        if is_new:
            self.order = {"sequence": (self.order["sequence"] + 1) % 256 or 1, "target_mm": target_mm}
        if is_new or self.order_due_us is None or self.order_due_us <= self.now_us:
            self.order_due_us = self.now_us + self.alley.refresh_us
            self.tell("DriveOrder", {**self.order, "speed_limit_mm_s": self.alley.speed_mm_s, "across": 0})

    def _give_back(self, needed: list[int]) -> None:
        keys = {self._segment(index) for index in needed}
        left = [key for key in self.rights.all_held() if key[0] == "SEGMENT" and key not in keys]
        home = self._segment(self.alley.home)
        if home not in keys and self.rights.holds(home) and home not in left:
            left.append(home)
        if left:
            self._place()
        for key in sorted(left):
            self.rights.give(key, self.alley.steward, self.now_us)
        for key in [key for key in self.rights.wanted if key[0] == "SEGMENT" and key not in keys]:
            del self.rights.wanted[key]

    def _handle(self, step: Step) -> bool:
        """C1, C3, U2."""
        assert self.shuttle is not None and self.shuttle_order is not None and step.call is not None
        self._stand()
        call = step.call
        station, car = ("STATION", step.station), ("CAR", call.car[0] << 16 | call.car[1])
        for key in (station, car):
            self.rights.want(key, self.now_us)
        if not (self.rights.holds(station) and self.rights.holds(car)):
            return False
        is_free = not [one for one, (where, *_) in self.cars.items() if where == step.station and one != call.car]
        if not step.takes and not is_free:
            return False
        wanted = self.shuttle_order.get("action")
        is_over = self.shuttle["sequence"] == self.shuttle_order["sequence"]
        if wanted is not None and not (is_over and self.shuttle["mode"] == _AFTER[wanted]):
            return False
        if self.actions:
            number = (self.shuttle_order["sequence"] + 1) % 256 or 1
            wheelbase_mm = self.cars[call.car][3] if call.car in self.cars else call.wheelbase_mm
            side = {"side": side_of(step.station), "wheelbase_mm": wheelbase_mm}
            self.shuttle_order = {"sequence": number, "action": self.actions.pop(0), **side}
            self.rights.journal.append(("step", dict(self.shuttle_order)))
            self.tell("ShuttleOrder", self.shuttle_order)
            return False
        self.shuttle_order = {"sequence": self.shuttle_order["sequence"]}
        self._handled(step, station, car)
        return True

    def _handled(self, step: Step, station: Key, car: Key) -> None:
        assert step.call is not None
        call, where = step.call, _ABOARD if step.takes else step.station
        version = self.rights.held[car]
        wheelbase_mm = self.cars[call.car][3] if call.car in self.cars else call.wheelbase_mm
        self.cars[call.car] = (where, self.alley.node, version, wheelbase_mm)
        self.rights.journal.append(("car", call.car, where, version))
        self._car_at(call.car, where, version, wheelbase_mm)
        for key in [station] if step.takes else [car, station]:
            self.rights.give(key, self.alley.steward, self.now_us)
        if not step.takes:
            self.done.append(call.task)
        self._report(call.task, "LOADED" if step.takes else "DONE", step.station)
