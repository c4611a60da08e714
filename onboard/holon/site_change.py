"""A new site file is rolled out while the site works: until it is over, machines of both files are of one site.

An operator names both digests (``SiteNext``) every two seconds. A machine that has one of them takes the other for its
own as well, says so, and so again every ten seconds. It is over when the operator says so, or is not heard for
``FORGOTTEN_US``; until then no other change counts. What may differ between the two files is the operator's business
(onboard/config/site_change.py).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from onboard.contract.change import ChangePhase, SiteNext
from onboard.contract.codes import CONTRACT_VERSION, Reason
from onboard.contract.constants import MAX_NODE_ID
from onboard.contract.messages import Heartbeat, Message
from onboard.core.effects import Effect, Report, Send

#: An operator that is not heard for so long has gone, us: five of its words are missed.
FORGOTTEN_US = 10_000_000
#: A machine says again so long after that it has heard of the change, us.
AGAIN_US = 10_000_000


@dataclass
class SiteChange:
    """What one machine knows of a change. Times are bus time in us."""

    node_id: int
    #: Digest of its own site file.
    own: int
    #: That of the other one that counts, 0 where none does; until when, and when that is said again.
    other: int = 0
    until_us: int = 0
    say_us: int = 0

    def handlers(self) -> dict[type[Message], Callable[[Any, int], list[Effect]]]:
        """Which method takes which message, with bus time in us as its second argument."""
        return {SiteNext: self.on_word}

    def strange(self, beat: Heartbeat, epoch: int) -> Reason:
        """Why a machine's words do not count: another contract, another site, or rights of another epoch; or NONE."""
        if beat.contract != CONTRACT_VERSION:
            return Reason.OTHER_CONTRACT
        if beat.site_digest not in (self.own, self.other):
            return Reason.OTHER_SITE
        return Reason.NONE if beat.epoch == epoch else Reason.OTHER_EPOCH

    def on_word(self, word: SiteNext, now_us: int) -> list[Effect]:
        """An operator's word counts, where it is about the file that this machine has; others' tell the operator."""
        if word.sender <= MAX_NODE_ID or self.own not in (word.site_digest, word.next_digest):
            return []
        other = word.next_digest if word.site_digest == self.own else word.site_digest
        if other == self.own:
            return []
        if self.other not in (0, other):
            return []
        if word.change_phase is not ChangePhase.ANNOUNCED:
            return self._end("it is over") if self.other and word.change_phase is ChangePhase.OVER else []
        self.until_us = now_us + FORGOTTEN_US
        if self.other:
            return []
        self.other, self.say_us = other, max(now_us, self.say_us)
        return [Report(f"a change of site: {other:04X} counts as {self.own:04X}"), *self.wake(now_us)]

    def wake(self, now_us: int) -> list[Effect]:
        """Say that the change was heard of, or forget it where its operator is gone."""
        if not self.other:
            return []
        if now_us >= self.until_us:
            return self._end("its operator is not heard any more")
        if now_us < self.say_us:
            return []
        self.say_us = now_us + AGAIN_US
        return [Send(SiteNext(self.node_id, self.own, self.other, ChangePhase.HEARD))]

    def next_wake(self) -> int | None:
        """When ``wake`` has something to do."""
        return min(self.until_us, self.say_us) if self.other else None

    def _end(self, why: str) -> list[Effect]:
        self.other = 0
        return [Report(f"the change of site has ended: {why}")]
