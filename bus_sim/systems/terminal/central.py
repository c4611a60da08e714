"""The paper's central planner beside the auction, for comparison (row M39): same plant, same bus, same robots.

One desk is the multi-mission planner: it chooses a box, makes plans for every robot that is available before T + delta
T over its own picture, and tells the one whose plan ends first what to carry. Robots carry out and report as always;
a violated plan is made anew by the same search on board.
"""

from dataclasses import dataclass, replace

from bus_sim.options import RunOptions
from bus_sim.systems.terminal.playing import play
from bus_sim.systems.terminal.run import TerminalOutcome, TerminalRun
from onboard.contract.codes import KindCode
from onboard.contract.terminal import Assignment, TaskTerms
from onboard.core.behaviour import BehaviourFactory, Fleet
from onboard.core.effects import Effect, Record, Send
from onboard.core.negotiation import Estimator
from onboard.core.serial import to_bus_ms
from onboard.core.site import Site
from onboard.systems.registry import factory_for
from onboard.systems.terminal.desk import Desk, DeskGeneration, TerminalDeskFactory
from onboard.systems.terminal.missions import Transport
from onboard.systems.terminal.search import BoxTransport, PlanSearch, remaining
from onboard.systems.terminal.site import Terminal
from onboard.ways.cars import car_fleet
from onboard.work.order_life import OrderEvent

#: An assignment that is in no plan yet is said again after this, us.
AGAIN_US = 2_000_000


@dataclass
class CentralDesk(Desk):
    """A desk that plans for the robots instead of calling them; one assignment at a time."""

    _pending: tuple[Transport, int, int] | None = None

    def call_next(self, now_us: int) -> list[Effect]:
        """The next assignment, once the plan for the last one was heard."""
        if self._pending is not None:
            last, told, said_us = self._pending
            if last.task in self.orders.open and self.mirror.in_plans(last.box) is None:
                return [] if now_us - said_us < AGAIN_US else self._assign(last, told, now_us)
            self._pending = None
        if not self.candidates(now_us):
            return []
        transport = self.orders.next(self.mirror, {one.box for one in self.orders.open.values()})
        if transport is None:
            return []
        vehicle = self._best(transport, now_us)
        if vehicle is None:
            self.orders.give_back(transport.task, OrderEvent.NOT_WON)
            return []
        won = self.won(transport.task, vehicle, now_us)
        return [Record(self.orders.record()), *won, *self._assign(transport, vehicle, now_us)]

    def _assign(self, transport: Transport, vehicle: int, now_us: int) -> list[Effect]:
        self._pending = (transport, vehicle, now_us)
        node = self.fleet.node_id
        date = TaskTerms(node, transport.task, to_bus_ms(transport.before_us))
        self.mirror.hear(date, now_us)
        return [Send(date), Send(Assignment(node, vehicle, transport.task, transport.box, transport.target))]

    def _best(self, transport: Transport, now_us: int) -> int | None:
        """The robot whose plan would end first (section 3c of the paper)."""
        source = self.mirror.station_of(transport.box)
        job = BoxTransport(transport.box, transport.task, source, transport.target, transport.before_us)
        avoid, found = self.mirror.long_blocked(now_us), []
        for node in self.candidates(now_us):
            free_us = self.mirror.traffic.end_of(node, now_us)
            search = PlanSearch(self.site, self.mirror.traffic, node, now_us, avoid)
            kept = remaining(self.mirror.traffic, node, now_us)
            plan = search.best(self.mirror.where[node], free_us, job, version=1, kept=kept)
            if plan is not None:
                found.append((plan.plan.end, node))
        return min(found)[1] if found else None


class CentralDeskFactory(TerminalDeskFactory):
    """Makes desks that plan for all vehicles, for comparison."""

    def behaviour(self, fleet: Fleet, estimator: Estimator) -> CentralDesk:
        """A desk that plans centrally. Raises ``TypeError`` for an estimator without the desk's picture."""
        if not isinstance(estimator, DeskGeneration):
            raise TypeError("a desk needs its own picture")
        return CentralDesk(car_fleet(fleet), estimator)


def central_factory(site: Site, kind: KindCode) -> BehaviourFactory:
    """As on every terminal, but for the desks."""
    return CentralDeskFactory() if kind is KindCode.DESK else factory_for(site, kind)


def at_one_desk(site: Terminal) -> Terminal:
    """The same missions, all typed at the first desk, so that both forms get them in the same place."""
    return replace(site, missions=tuple(replace(one, desk=site.desk) for one in site.missions))


def play_central(site: Terminal, options: RunOptions, *, limit_us: int) -> TerminalOutcome:
    """A run under the central planner."""

    def prepare(run: TerminalRun) -> None:
        run.factories = central_factory

    return play(at_one_desk(site), options, limit_us=limit_us, prepare=prepare)


def play_auction(site: Terminal, options: RunOptions, *, limit_us: int) -> TerminalOutcome:
    """Play the same missions at one desk by calls and bids; ``limit_us`` of virtual time at most."""
    return play(at_one_desk(site), options, limit_us=limit_us)
