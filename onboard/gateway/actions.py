"""Instant actions of VDA 5050 (2.1, section 6.8): their states, as a machine's `state` tells them."""

from collections import OrderedDict
from dataclasses import dataclass, field

from onboard.gateway.dialect import Dialect, Json

#: States of instant actions that are told, the newest so many.
KEPT = 16


@dataclass
class InstantActions:
    """The states of one machine's instant actions, by their identifiers."""

    states: "OrderedDict[str, Json]" = field(default_factory=OrderedDict)

    def is_known(self, action: Json) -> bool:
        """Whether it came before: then it is not done again."""
        return action["actionId"] in self.states

    def begin(self, action: Json) -> None:
        """It runs: what it asks for is under way."""
        self._tell(action, {"actionStatus": "RUNNING"})

    def close(self, dialect: Dialect, action: Json, failure: str) -> None:
        """Finished, or failed for a reason."""
        key = "actionResult" if dialect.is_third else "resultDescription"
        self._tell(action, {"actionStatus": "FAILED" if failure else "FINISHED"} | ({key: failure} if failure else {}))

    def _tell(self, action: Json, status: Json) -> None:
        name = action["actionId"]
        self.states[name] = {"actionId": name, "actionType": action["actionType"]} | status
        while len(self.states) > KEPT:
            self.states.popitem(last=False)
