"""From one cell to the next: the right, the order to the body, the load, and the right that is passed on."""

from dataclasses import dataclass, field

from onboard.contract.codes import Reason
from onboard.contract.mapd import CartAction
from onboard.core.authority import TokenKey
from onboard.core.behaviour import Fleet
from onboard.core.effects import Effect
from onboard.core.motion_authority import Permit, authorised
from onboard.systems.mapd.cart import Cart
from onboard.systems.mapd.fields import NO_TASK
from onboard.systems.mapd.knowledge import Knowledge
from onboard.systems.mapd.memory import served_record, step_record
from onboard.systems.mapd.paths import Path
from onboard.systems.mapd.rights import cell_token, resource_of
from onboard.systems.mapd.site import Mapd

#: A right that somebody who leaves in this step should pass on is asked for after this, us: rights that come by
#: themselves are there by then.
EXPECTED_US = 150_000


@dataclass
class Driving:
    """The body and the rights of one robot."""

    fleet: Fleet
    site: Mapd
    knowledge: Knowledge
    cart: Cart = field(init=False)
    #: Step that was written down last before setting out, and the one from which the right was passed on.
    _recorded: int = -1
    _passed: int = -1
    #: Cell or zone that it sets out for, and when its right is asked for.
    _entering: int | None = None
    _want_us: int | None = None
    #: Task that was to be unloaded last.
    unloaded: int = NO_TASK

    def __post_init__(self) -> None:
        self.cart = Cart(self.fleet.node_id)

    def next_wake(self) -> int | None:
        """When an order is to be said again, or a right to be asked for."""
        return min((time for time in (self.cart.again_us, self._want_us) if time is not None), default=None)

    def go(self, path: Path, step: int, task: int, now_us: int) -> tuple[list[Effect], bool, bool]:
        """On the way from ``step`` to the next: effects, whether the task was served, and whether it is there."""
        body = self.cart.state
        assert body is not None
        cell, to = path.at(step), path.at(step + 1)
        if (
            body.cell == cell
            and self._recorded <= step
            and (work := self._work(cell, task, step, step, now_us)) is not None
        ):
            return work, False, False
        effects: list[Effect] = []
        if self._recorded <= step:
            self._recorded = step + 1
            effects.append(step_record(step + 1))
        if body.cell != to:
            return effects + self._enter(to, step, now_us), False, False
        if self._passed != step:
            self._passed = step
            effects += self._pass_on(self.site.floor.resources[cell], now_us)
        work = None if body.moving else self._work(to, task, step, step + 1, now_us)
        if body.moving or work is not None:
            return effects + (work or []), False, False
        return effects, body.task == NO_TASK and self.unloaded == task != NO_TASK, True

    def _work(self, cell: int, task: int, since: int, step: int, now_us: int) -> list[Effect] | None:
        """Load or unload, on the way from ``since`` and done at ``step``; None where nothing is left to do here."""
        body, known = self.cart.state, self.knowledge.tasks.get(task)
        assert body is not None
        if known is None or body.moving:
            return None
        if body.task == task and cell == known.delivery:
            first, self.unloaded = self.unloaded != task, task
            record: list[Effect] = [served_record(task, since)] if first else []
            return record + self.cart.order(self._permit(cell), CartAction.UNLOAD, cell, task, step, now_us)
        if body.task == NO_TASK and cell == known.pickup and self.unloaded != task:
            return self.cart.order(self._permit(cell), CartAction.LOAD, cell, task, step, now_us)
        return None

    def _enter(self, to: int, step: int, now_us: int) -> list[Effect]:
        """Move once the right is there: waited for from whoever leaves the cell in this step, else asked for."""
        resource = self.site.floor.resources[to]
        key, tokens = cell_token(resource), self.fleet.tokens
        self._entering = resource
        permit = self._permit(to)
        if permit:
            self._want_us = None
            return self.cart.order(permit, CartAction.MOVE, to, NO_TASK, step + 1, now_us)
        if key in tokens.wanted:
            return []
        if self._want_us is None:
            self._want_us = now_us + (EXPECTED_US if self._is_expected(resource, step) else 0)
        if now_us < self._want_us:
            return []
        self._want_us = None
        return tokens.want(key, now_us)

    def _permit(self, cell: int) -> Permit:
        """To be in a cell, and to work there."""
        return authorised(self.fleet.motion, [cell_token(self.site.floor.resources[cell])])

    def _is_expected(self, resource: int, step: int) -> bool:
        """Whether somebody is there by the paths until this step."""
        paths = self.knowledge.paths
        cells = (path.at(step) for node, path in paths.by_robot.items() if node != self.fleet.node_id)
        return any(self.site.floor.resources[cell] == resource for cell in cells)

    def _pass_on(self, left: int, now_us: int) -> list[Effect]:
        """The right to what was left goes to whoever is there next; with nobody in sight it stays here."""
        self._entering = self._want_us = None
        body, tokens, me = self.cart.state, self.fleet.tokens, self.fleet.node_id
        assert body is not None
        key = cell_token(left)
        if left == self.site.floor.resources[body.cell] or not tokens.holds(key):
            return []
        user = self.knowledge.next_user(left, leaving=me)
        return [] if user is None or user == me else tokens.give(key, user, now_us)

    def may_grant(self, key: TokenKey, requester: int, step: int) -> Reason:
        """NONE where the body is elsewhere, does not set out for it, and the requester is there first by the paths."""
        resource, body = resource_of(key), self.cart.state
        if body is None or resource in (self._entering, self.site.floor.resources[body.cell]):
            return Reason.TOKEN_NOT_GRANTABLE_YET
        path = self.knowledge.paths.by_robot.get(self.fleet.node_id)
        is_gone = path is not None and path.at(step) != body.cell
        user = self.knowledge.next_user(resource, leaving=self.fleet.node_id if is_gone else 0)
        if user == requester:
            return Reason.NONE
        return Reason.MIRROR_BEHIND if user is None else Reason.TOKEN_NOT_GRANTABLE_YET
