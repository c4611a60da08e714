"""What a vehicle has not begun goes to others where it does not go on, or its box is another's (docs/terminal.md)."""

from dataclasses import dataclass, field

from onboard.contract.codes import KindCode, Reason, TaskPhase, TokenKind
from onboard.contract.messages import Award, TaskReport
from onboard.core.authority import TokenKey
from onboard.core.behaviour import Fleet
from onboard.core.effects import Effect, Send
from onboard.systems.terminal.generation import VehicleGeneration
from onboard.systems.terminal.mirror import TerminalMirror
from onboard.systems.terminal.plan import NO_STEP, Load
from onboard.ways.tokens import car_token
from onboard.work.manual import GIVE_BACK_US


@dataclass
class UnbegunLoads:
    """Loads of one vehicle's plan that are not picked up; but for those that are gone, it has no right to them yet."""

    fleet: Fleet
    generation: VehicleGeneration
    #: Boxes that were given back: the right to one may have been on its way, and goes back too.
    given_back: set[int] = field(default_factory=set)
    #: Since when I do not go on, and could give something back, us.
    _out_since_us: int | None = None
    #: ``TerminalMirror.given_up`` when boxes under others were last looked at.
    _given_up: int = 0

    @property
    def _mirror(self) -> TerminalMirror:
        return self.generation.mirror

    def right_to(self, load: Load) -> TokenKey:
        """The right to touch its box."""
        return car_token(*self.generation.site.box(load.box))

    def note(self, now_us: int) -> None:
        """Since when I am held, or behind somebody who does not go on, with something that I have not begun."""
        traffic, is_held = self._mirror.traffic, self.generation.is_held
        if not (is_held or traffic.out or self._out_since_us is not None):
            return
        is_out = is_held or traffic.waits_for_good(self.fleet.node_id, now_us)
        if not is_out or not self._all():
            self._out_since_us = None
        elif self._out_since_us is None:
            self._out_since_us = now_us

    def begin_anew(self) -> None:
        """The minute begins anew: something was given back, or a person is at work with me, perhaps step by step."""
        self._out_since_us = None

    @property
    def due_us(self) -> int | None:
        """When something is to be given back, as I do not go on, us."""
        return None if self._out_since_us is None else self._out_since_us + GIVE_BACK_US

    def due(self, now_us: int) -> list[Load]:
        """What others may do, as I do not go on; what is aboard, or being picked up, stays mine."""
        return self._all() if self.due_us is not None and now_us >= self.due_us else []

    @property
    def is_to_look(self) -> bool:
        """Whether somebody has given a box back since boxes under others were looked at, or I am refused mine.

        Who was off as that was given back did not hear it (drawn terminal 44).
        """
        is_refused = any(key.kind is TokenKind.CAR for key in self.fleet.tokens.refused)
        return is_refused or self._mirror.given_up != self._given_up

    def buried(self) -> list[Load]:
        """A box under one that its fetcher has given back, and all after it: others could not come to that stack."""
        self._given_up = self._mirror.given_up
        loads = self._all()
        return _from(loads, min((one.pick for one in loads if not self._mirror.is_free(one.box)), default=None))

    def gone(self) -> list[Load]:
        """A box that another carried away, for a task taken back from it, and all after it: it would not be found.

        Both plans have it where the other vehicle was not heard as the second was made (drawn terminal 43).
        """
        loads = self._coming()
        return _from(loads, min((one.pick for one in loads if self._is_gone(one)), default=None))

    def after(self, award: Award) -> list[Load]:
        """What a desk has given to another, or to nobody, and what comes after.

        That was planned from where the first would have been put down.
        """
        desk = self.generation.site.machines.get(award.sender)
        loads = self._all() if desk is not None and desk.kind is KindCode.DESK else []
        return _from(loads, min((one.pick for one in loads if one.task == award.task), default=None))

    def give(self, loads: list[Load]) -> list[Effect]:
        """They are in my plan no more: I ask for their boxes no more, and say so."""
        for one in loads:
            self.fleet.tokens.forget(self.right_to(one))
            self.given_back.add(one.box)
        node = self.fleet.node_id
        return [Send(TaskReport(node, one.task, TaskPhase.FORFEITED, 0, Reason.NONE)) for one in loads]

    def _all(self) -> list[Load]:
        return [one for one in self._coming() if not self.fleet.tokens.holds(self.right_to(one))]

    def _coming(self) -> list[Load]:
        owned = self._mirror.traffic.plans.get(self.fleet.node_id)
        return [] if owned is None else [one for one in owned.plan.loads if owned.current <= one.pick < NO_STEP]

    def _is_gone(self, load: Load) -> bool:
        """Whether its box is said to stand elsewhere, or to be aboard another."""
        record = self._mirror.fleet.cars.get(self.generation.site.box(load.box))
        at = self._mirror.traffic.plans[self.fleet.node_id].plan.steps[load.pick].entity
        return record is not None and record.station != at and record.custodian != self.fleet.node_id


def _from(loads: list[Load], first: int | None) -> list[Load]:
    """All that are picked up from step ``first`` on; nothing for None."""
    return [] if first is None else [one for one in loads if one.pick >= first]
