"""Who may say what: only machines of the site count, each with what its kind may say (design, section 5).

What kinds may say stands in the DBC (``BO_TX_BU_``) and comes in as a value, as the core knows no wire. Nodes 251 to
255 say what a gateway may. All else is as if it had not been heard, and is counted; only an emergency stop counts from
anybody.
"""

from dataclasses import dataclass, field

from onboard.contract.codes import KindCode, Reason
from onboard.contract.constants import MAX_NODE_ID, MOBILE_KINDS, Speakers
from onboard.contract.messages import Blocked, BusTime, Clear, EmergencyStop, ManualOrder, Message
from onboard.contract.runs import singles
from onboard.core.effects import Effect, Report
from onboard.core.site import Site

#: Highest number that a node can have on the wire.
_LAST_NODE_ID = 255
#: What no machine that moves says, whatever its system calls it.
_OF_FIXED = (BusTime, ManualOrder)
#: What a machine says only of tracks whose steward it is.
_OF_STEWARDS = (Blocked, Clear)


@dataclass
class Admission:
    """What one machine listens to. Without ``speakers``, in a test of decisions alone, every kind says everything."""

    site: Site
    speakers: Speakers | None = None
    #: Nodes whose words came to nothing, each with the reason that was told to people.
    _named: set[tuple[int, Reason]] = field(default_factory=set)
    #: What each kind may say: the site never changes, and new speakers begin it anew.
    _says: dict[KindCode, frozenset[type[Message]]] = field(default_factory=dict)

    def listen(self, speakers: Speakers) -> None:
        """From now on only who may say a message is heard with it."""
        self.speakers = dict(speakers)
        self._says.clear()

    def says(self, node: int) -> frozenset[type[Message]]:
        """What a machine of the site may say, by its kind: of some it counts by its track or its run too."""
        machine = self.site.machines.get(node)
        if machine is None or self.speakers is None:
            return frozenset()
        if machine.kind not in self._says:
            said = (one for one in self.speakers if self._why_never(node, one) is Reason.NONE)
            self._says[machine.kind] = frozenset(said)
        return self._says[machine.kind]

    def why_not(self, message: Message) -> Reason:
        """NONE where a message counts; else NOT_OF_SITE, NOT_OF_KIND, or NOT_AUTHORISED for a track of another's.

        VALUE_OUT_OF_RANGE for a run that is longer than any.
        """
        is_sayable = type(message) in self.says(message.sender)
        verdict = Reason.NONE if is_sayable else self._why_never(message.sender, type(message))
        if verdict is Reason.NONE and not singles(message):
            return Reason.VALUE_OUT_OF_RANGE
        if verdict is not Reason.NONE or not isinstance(message, _OF_STEWARDS):
            return verdict
        is_gateway = message.sender not in self.site.machines
        may_say = is_gateway or self.site.stewards.get(message.track) == message.sender
        return Reason.NONE if may_say else Reason.NOT_AUTHORISED

    def _why_never(self, sender: int, kind_of_message: type[Message]) -> Reason:
        if issubclass(kind_of_message, EmergencyStop):
            return Reason.NONE
        machine = self.site.machines.get(sender)
        if machine is None and not MAX_NODE_ID < sender <= _LAST_NODE_ID:
            return Reason.NOT_OF_SITE
        kind = KindCode.OBSERVER if machine is None else machine.kind
        if self.speakers is not None and kind not in self.speakers.get(kind_of_message, ()):
            return Reason.NOT_OF_KIND
        is_fixed_only = issubclass(kind_of_message, _OF_FIXED) and machine is not None
        return Reason.NOT_OF_KIND if is_fixed_only and kind in MOBILE_KINDS else Reason.NONE

    def passed_over(self, message: Message, why: Reason) -> list[Effect]:
        """Tell people once of each sender and reason: what it may not say is as if it had not been heard."""
        if (message.sender, why) in self._named:
            return []
        self._named.add((message.sender, why))
        return [Report(f"{type(message).__name__} of node {message.sender} passed over: {why.name}")]
