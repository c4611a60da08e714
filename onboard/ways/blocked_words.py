"""Words that a segment cannot be passed, or can again: taken up, kept by its steward, and said again by it."""

from collections.abc import Iterable
from dataclasses import dataclass

from onboard.contract.messages import Blocked, Clear
from onboard.core.effects import Effect, Record, Send
from onboard.core.journal_records import Entry, records_in
from onboard.core.records import BlockedRecord, ClearRecord
from onboard.ways.obstacles import Obstacles
from onboard.ways.site import WaySite


@dataclass
class BlockedWords:
    """One machine's part in it; all times are bus time in us."""

    site: WaySite
    node_id: int
    obstacles: Obstacles

    def replay(self, entries: Iterable[Entry]) -> None:
        """After a restart what is in my journal is blocked, or clear, as it was."""
        for record in records_in(entries, BlockedRecord, ClearRecord):
            word = Blocked if isinstance(record, BlockedRecord) else Clear
            self.obstacles.hear(word(self.node_id, record.track, record.index, record.reason), 0)

    def hear(self, word: Blocked | Clear, now_us: int) -> list[Effect]:
        """A segment is blocked, or clear again; what I am steward of is in my journal."""
        is_mine = self.site.stewards.get(word.track) == self.node_id
        if not self.obstacles.hear(word, now_us) or not is_mine:
            return []
        record = BlockedRecord if isinstance(word, Blocked) else ClearRecord
        return [Record(record(word.track, word.index, word.reason))]

    def statements(self) -> list[Effect]:
        """What I say again, of the tracks that I am steward of, to whoever asks."""
        tracks = [track for track, steward in self.site.stewards.items() if steward == self.node_id]
        return [Send(word) for word in self.obstacles.words(self.node_id, tracks)]
