"""What a kind of machine is built on that bids for nothing, or does nothing by itself."""

from dataclasses import dataclass

from onboard.contract.codes import KindCode, MachineState, Reason
from onboard.contract.messages import CallForProposals, Message
from onboard.core.authority import TokenKey
from onboard.core.behaviour import Fleet
from onboard.core.effects import Effect
from onboard.core.negotiation import NegotiationEvent, Proposal


class NoEstimator:
    """The task-generation function of a machine that bids for nothing: a desk, a host of node agents."""

    def floor(self, call: CallForProposals, now_us: int) -> int:
        """Asked for in vain: whoever has no lower bound has no floor either."""
        return 0

    def lower_bound(self, call: CallForProposals, now_us: int) -> int | None:
        """None: it can do nothing."""
        return None

    def estimate(self, call: CallForProposals, now_us: int) -> Proposal | None:
        """None: it can do nothing."""
        return None


@dataclass
class Plain:
    """A behaviour that does nothing by itself: a kind built on it writes only what its machine does."""

    fleet: Fleet
    kind: KindCode = KindCode.ANY
    state: MachineState = MachineState.IDLE
    itinerary_version: int = 0

    def start(self, now_us: int) -> list[Effect]:
        """Nothing to silence, nothing to ask."""
        return []

    def sense(self, message: Message, now_us: int) -> list[Effect]:
        """Nothing, where a machine has no devices."""
        return []

    def hear(self, message: Message, now_us: int) -> list[Effect]:
        """Nothing beyond what tokens, mirror and negotiation have heard."""
        return []

    def negotiated(self, event: NegotiationEvent, now_us: int) -> list[Effect]:
        """Whatever is won, nothing is done for it."""
        return []

    def may_grant(self, key: TokenKey, requester: int, now_us: int) -> Reason:
        """Nothing that it holds is used."""
        return Reason.NONE

    def advance(self, now_us: int) -> list[Effect]:
        """Nothing, where a machine does only what it is told."""
        return []

    def next_wake(self) -> int | None:
        """None: nothing of its own is ever due."""
        return None

    def statements(self, now_us: int) -> list[Effect]:
        """Nothing, where a machine holds no rights to vouch for."""
        return []
