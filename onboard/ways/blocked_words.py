"""Words that a segment cannot be passed, or can again: taken up, kept by its steward, and said again by it."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from onboard.core.codes import Reason
from onboard.core.effects import Effect, Record, Send
from onboard.core.messages import Blocked, Clear
from onboard.ways.obstacles import Obstacles
from onboard.ways.site import WaySite


@dataclass
class BlockedWords:
    """One machine's part in it; all times are bus time in us."""

    site: WaySite
    node_id: int
    obstacles: Obstacles

    def replay(self, entries: Iterable[Mapping[str, str | int]]) -> None:
        """After a restart what is in my journal is blocked, or clear, as it was."""
        for entry in entries:
            if entry.get("record") in ("blocked", "clear"):
                word = Blocked if entry["record"] == "blocked" else Clear
                told = word(self.node_id, int(entry["track"]), int(entry["index"]), Reason(int(entry["reason"])))
                self.obstacles.hear(told, 0)

    def hear(self, word: Blocked | Clear, now_us: int) -> list[Effect]:
        """A segment is blocked, or clear again; what I am steward of is in my journal."""
        is_mine = self.site.stewards.get(word.track) == self.node_id
        if not self.obstacles.hear(word, now_us) or not is_mine:
            return []
        record = "blocked" if isinstance(word, Blocked) else "clear"
        return [Record({"record": record, "track": word.track, "index": word.index, "reason": int(word.reason)})]

    def statements(self) -> list[Effect]:
        """What I say again, of the tracks that I am steward of, to whoever asks."""
        tracks = [track for track, steward in self.site.stewards.items() if steward == self.node_id]
        return [Send(word) for word in self.obstacles.words(self.node_id, tracks)]
