"""Numbers that every machine of a contract knows, beside those that the DBC files say themselves."""

from collections.abc import Mapping

from onboard.contract.base import Message
from onboard.contract.codes import KindCode, MachineState

#: Bits of ``Award.task_version``, a serial number.
TASK_VERSION_BITS = 7
#: Highest version of a token: 163 years of the busiest slot, so that it never wraps (28 bits in dbc/fleet.dbc).
MAX_VERSION = (1 << 28) - 1
#: Bits of a token's version as ``TokenRequest`` and ``TokenRefusal`` tell it, a serial number.
SEEN_VERSION_BITS = 20
#: Nobody: no node carries this node-ID.
NOBODY = 0
#: Highest node-ID; 251 to 255 are kept for gateways and tools.
MAX_NODE_ID = 250
#: "The bidder chooses": a station field that names none.
ANY_STATION = 0xFFFF
#: Where a car is that has left the park.
OUTSIDE = 0xFFFE
#: What moves about; all other machines are fixed, keep tokens at first and one of them gives the bus time.
MOBILE_KINDS = frozenset({KindCode.ROBOT, KindCode.VEHICLE, KindCode.ARM})
#: States in which a machine that lives is an obstacle all the same.
STILL = (MachineState.OBSTACLE, MachineState.STOPPED)
#: States in which a machine takes part and nobody holds it.
ACTING = (MachineState.IDLE, MachineState.WORKING)

#: By class of message the kinds of machine that may say it; ``KindCode.OBSERVER`` stands for nodes 251 to 255.
Speakers = Mapping[type[Message], frozenset[KindCode]]
