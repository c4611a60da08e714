"""A fixed machine as steward of a track: grants segments in passing order, keeps stored cars and their places."""

from dataclasses import dataclass, field

from onboard.core.authority import TokenKey, car_token
from onboard.core.behaviour import Fleet
from onboard.core.codes import OUTSIDE, CallResult, Operation, Reason, TokenKind
from onboard.core.effects import Effect, Send
from onboard.core.messages import Award, CallForProposals, CarAt, Message, Reference, TokenGrant
from onboard.core.petitions import UNORDERED
from onboard.core.site import Segment
from onboard.kinds.car_park.bay_memory import BayMemory, car_record, winner_record

#: Calls remembered to know which car an award is about; older ones are long closed.
MAX_CALLS = 64


@dataclass
class Stewardship:
    """Grant rules and custody of one steward. ``winners`` names the machine that may fetch a car."""

    fleet: Fleet
    winners: dict[Reference, int] = field(default_factory=dict)
    _cars_of_calls: dict[tuple[int, int], Reference] = field(default_factory=dict)

    def replay(self, memory: BayMemory) -> None:
        """Take up what the journal tells of the cars that are in my custody still."""
        self.winners.update(memory.winners)
        for car, statement in memory.cars.items():
            if self.fleet.tokens.holds(car_token(*car)):
                self.fleet.mirror.on_car(statement)

    def hear(self, message: Message) -> list[Effect]:
        """Learn from calls and awards; state a car anew when its token has come to me."""
        match message:
            case CallForProposals() if message.operation in (Operation.PARK, Operation.RETRIEVE):
                self._cars_of_calls[message.sender, message.call] = message.car
                while len(self._cars_of_calls) > MAX_CALLS:
                    del self._cars_of_calls[next(iter(self._cars_of_calls))]
            case Award() if message.result is CallResult.AWARDED:
                car = self._cars_of_calls.get((message.sender, message.call))
                if car is not None and self.winners.get(car) != message.winner:
                    self.winners[car] = message.winner
                    return [winner_record(car, message.winner)]
            case TokenGrant() if message.token_kind is TokenKind.CAR and message.holder == self.fleet.node_id:
                return self._take_custody(Reference(message.token >> 16, message.token & 0xFFFF), message.version)
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """NONE where the token may go to ``requester`` now."""
        if key.kind is TokenKind.SEGMENT:
            return self._passing_order(Segment(key.number >> 8, key.number & 0xFF), key, requester, now_us)
        if key.kind is TokenKind.CAR:
            car = Reference(key.number >> 16, key.number & 0xFFFF)
            return Reason.NONE if self.winners.get(car) == requester else Reason.TOKEN_NOT_GRANTABLE_YET
        return Reason.NONE

    def car_statements(self) -> list[Effect]:
        """Where each car in my custody stands."""
        return [
            Send(CarAt(self.fleet.node_id, car, record.station, record.version, record.wheelbase_mm))
            for car, record in self.fleet.mirror.cars.items()
            if record.custodian == self.fleet.node_id and record.station != OUTSIDE
        ]

    def _take_custody(self, car: Reference, version: int) -> list[Effect]:
        record = self.fleet.mirror.cars.get(car)
        if record is None or not self.fleet.tokens.holds(car_token(*car)):
            return []
        self.winners.pop(car, None)
        statement = CarAt(self.fleet.node_id, car, record.station, version, record.wheelbase_mm)
        return [car_record(statement), Send(statement)] if self.fleet.mirror.on_car(statement) else []

    def _passing_order(self, segment: Segment, key: TokenKey, requester: int, now_us: int) -> Reason:
        """Tokens go in the plan's order, as its holder and the requester both see it; without one to the oldest."""
        claim = self.fleet.petitions.claim(key, requester)
        if claim is None:
            return Reason.TOKEN_NOT_GRANTABLE_YET
        if claim.itinerary_version == UNORDERED:
            oldest = self.fleet.petitions.is_oldest_unordered(key, requester, now_us)
            return Reason.NONE if oldest else Reason.TOKEN_NOT_GRANTABLE_YET
        order = self.fleet.mirror.order
        return order.verdict(requester, segment, claim.itinerary_version, claim.predecessor)
