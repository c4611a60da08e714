"""How fast the device answers: from a call to its bid, from a grant to its motion."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from hil.stage import BenchMessage
from onboard.contract.codes import DriveMode, TokenKind
from onboard.contract.messages import Bid, CallForProposals, DriveState, Message, TokenGrant


@dataclass
class Latencies:
    """In us, in the order of the run; each as seen on the bus, from the end of one frame to the end of another.

    ``call_to_bid`` includes the pause by which better bids speak sooner (design, section 4). ``grant_to_motion`` is
    from the last token that a standing device was given to the first word of its drive that it moves.
    """

    call_to_bid: list[int] = field(default_factory=list)
    grant_to_motion: list[int] = field(default_factory=list)

    def worst(self) -> dict[str, int]:
        """The longest of each kind that was seen, us."""
        found = {"call_to_bid": self.call_to_bid, "grant_to_motion": self.grant_to_motion}
        return {f"{name}_worst_us": max(values) for name, values in found.items() if values}


def latencies_of(said: Iterable[BenchMessage[Message]], node_id: int) -> Latencies:
    """What a run tells of one device."""
    found = Latencies()
    calls: dict[tuple[int, int], int] = {}
    granted_us: int | None = None
    is_moving = False
    for one in said:
        match one.message:
            case CallForProposals(sender=initiator, call=call):
                calls[initiator, call] = one.time_us
            case Bid(sender=sender, initiator=initiator, call=call) if sender == node_id:
                called_us = calls.pop((initiator, call), None)
                if called_us is not None:
                    found.call_to_bid.append(one.time_us - called_us)
            case TokenGrant(holder=holder, token_kind=TokenKind.SEGMENT) if holder == node_id and not is_moving:
                granted_us = one.time_us
            case DriveState(sender=sender, mode=mode) if sender == node_id:
                moves = mode is not DriveMode.STANDING
                if moves and not is_moving and granted_us is not None:
                    found.grant_to_motion.append(one.time_us - granted_us)
                    granted_us = None
                is_moving = moves
    return found
