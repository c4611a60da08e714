"""Custody of parts (row C17): who holds a part's token may take it up. Asked for, given on, and given back."""

from dataclasses import dataclass

from onboard.contract.cell import PartAt
from onboard.contract.codes import Reason, TokenKind
from onboard.contract.messages import Reference
from onboard.core.authority import TokenBook, TokenKey
from onboard.core.effects import Effect, Send
from onboard.systems.cell.contracts import part_token
from onboard.systems.cell.memory import Undertaking
from onboard.systems.cell.records import ContractStage
from onboard.work.undertaking import Undertakings


def token_of(one: Undertaking) -> TokenKey:
    """The token of the part that a contract is about."""
    return part_token(one.contract.goal.part)


def _part_of(key: TokenKey) -> Reference:
    return Reference(key.number >> 16, key.number & 0xFFFF)


@dataclass
class PartCustody:
    """The rights of one robot to the parts of its contracts."""

    node_id: int
    tokens: TokenBook
    tasks: Undertakings[Undertaking]

    def may_take(self, one: Undertaking) -> bool:
        """Whether the part is in my custody."""
        return self.tokens.holds(token_of(one))

    def want(self, now_us: int) -> list[Effect]:
        """Ask for the parts of all contracts that are not begun."""
        effects: list[Effect] = []
        for one in self.tasks.in_hand.values():
            if one.stage is ContractStage.WON:
                effects += self.tokens.want(token_of(one), now_us)
        return effects

    def want_no_more(self) -> None:
        """Ask for none; a grant that still comes is taken."""
        for one in self.tasks.in_hand.values():
            self.tokens.forget(token_of(one))

    def may_grant(self, key: TokenKey, requester: int) -> Reason:
        """A part goes to the sub-contractor, once it lies where that takes over."""
        if key.kind is not TokenKind.CAR:
            return Reason.NOT_AUTHORISED
        one = self._contract_of(_part_of(key))
        if one is None or one.stage is not ContractStage.PUT or one.successor != requester:
            return Reason.TOKEN_NOT_GRANTABLE_YET
        return Reason.NONE

    def give_back(self, now_us: int) -> list[Effect]:
        """A part that lies at its goal goes back into the custody of the goal manager that named it."""
        effects: list[Effect] = []
        for key in self.tokens.mine():
            part = _part_of(key)
            if key.kind is TokenKind.CAR and self._contract_of(part) is None:
                effects += self.tokens.give(key, part.origin, now_us)
        return effects

    @property
    def not_begun(self) -> list[Undertaking]:
        """Contracts whose parts are in my custody, and which I have not begun to take."""
        return [one for one in self.tasks.in_hand.values() if one.stage is ContractStage.WON and self.may_take(one)]

    def leave(self, now_us: int) -> list[Effect]:
        """What is not begun goes back to whoever gave it to me, who can give it to another then."""
        effects: list[Effect] = []
        for one in self.not_begun:
            self.tasks.left.add(one.task)
            effects += [*self.tokens.give(token_of(one), one.manager, now_us), self.tasks.report(one.task)]
        return effects

    def words(self) -> list[Effect]:
        """Where the parts in my custody are."""
        mine = (one for one in self.tasks.in_hand.values() if self.may_take(one))
        return [self.part_at(one) for one in mine if one.stage in (ContractStage.TAKEN, ContractStage.PUT)]

    def part_at(self, one: Undertaking) -> Send:
        """Where the part of a contract is, which has been taken."""
        aboard = one.stage is ContractStage.TAKEN
        place = one.contract.goal.start if aboard else one.contract.move.via
        return Send(PartAt(self.node_id, one.contract.goal.part, place.x_mm, aboard, place.y_mm))

    def _contract_of(self, part: Reference) -> Undertaking | None:
        return next((one for one in self.tasks.in_hand.values() if one.contract.goal.part == part), None)
