"""Instant actions of VDA 5050 (2.1, section 6.8): what is done at once, and what a machine without a master refuses."""

from collections import OrderedDict
from dataclasses import dataclass, field

from onboard.gateway.dialect import Dialect, Json

#: States of instant actions that are told, the newest so many.
KEPT = 16
#: Why an action is not carried out. A machine stops where its own plan and rights say so, and by its emergency circuit.
_NO_PAUSE = "not supported: a machine is stopped by its own safety circuit, not from afar"
REFUSED = {"startPause": _NO_PAUSE, "stopPause": _NO_PAUSE}


@dataclass
class InstantActions:
    """The states of one machine's instant actions, by their identifiers."""

    states: "OrderedDict[str, Json]" = field(default_factory=OrderedDict)

    def is_known(self, action: Json) -> bool:
        """Whether it came before: then it is not done again."""
        return action["actionId"] in self.states

    def close(self, dialect: Dialect, action: Json, failure: str) -> None:
        """Finished, or failed for a reason."""
        key = "actionResult" if dialect.is_third else "resultDescription"
        told: Json = {"actionId": action["actionId"], "actionType": action["actionType"]}
        told |= {"actionStatus": "FAILED" if failure else "FINISHED"} | ({key: failure} if failure else {})
        self.states[action["actionId"]] = told
        while len(self.states) > KEPT:
            self.states.popitem(last=False)
