"""The Mechatronics Interaction Protocol (MIP) of Pujo, Ounnar and Zanni: a contract net without a manager."""

from onboard.core.negotiation.bidding import (
    DelayRule,
    SpeakingSlot,
    beats,
    cost_difference,
    cut_off_us,
    delay_us,
    last_bid_us,
    slot_of,
)
from onboard.core.negotiation.counters import Counters
from onboard.core.negotiation.events import (
    EVENT_TYPES,
    Awarded,
    AwardedAgain,
    CallKey,
    Closed,
    Estimator,
    NeededAnswers,
    NegotiationEvent,
    PreAssigned,
    Proposal,
    Released,
    RequestedTerms,
    SubCallAnswer,
)
from onboard.core.negotiation.initiator import Initiator, RestartPolicy, RestartStep
from onboard.core.negotiation.negotiation import Negotiation, negotiation_of
from onboard.core.negotiation.participant import Participant

__all__ = [
    "EVENT_TYPES",
    "Awarded",
    "AwardedAgain",
    "CallKey",
    "Closed",
    "Counters",
    "DelayRule",
    "Estimator",
    "Initiator",
    "NeededAnswers",
    "Negotiation",
    "NegotiationEvent",
    "Participant",
    "PreAssigned",
    "Proposal",
    "Released",
    "RequestedTerms",
    "RestartPolicy",
    "RestartStep",
    "SpeakingSlot",
    "SubCallAnswer",
    "beats",
    "cost_difference",
    "cut_off_us",
    "delay_us",
    "last_bid_us",
    "negotiation_of",
    "slot_of",
]
