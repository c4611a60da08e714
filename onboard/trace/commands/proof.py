"""Which frames of a log are sealed, and by a key file which of them counted on its bus."""

import argparse
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator

from onboard.config.keys import load_keys
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.seal.keys import Keys
from onboard.seal.marks import SealMark, SealMarks
from onboard.seal.subjects import Reading
from onboard.systems.contract import codecs_for
from onboard.trace.commands.common import TraceError
from onboard.trace.raw import RawFrame

#: What of a node did not count, in the words of the verdict.
_WRONG = {
    SealMark.UNSEALED: "without a seal",
    SealMark.WRONG: "with false seals",
    SealMark.AGAIN: "said again",
    SealMark.NOT_FRESH: "under a number that the log does not tell",
}


class LogProof:
    """Marks each frame of a log; every channel is a bus of its own. ``mark`` is that of the frame handed out last.

    With the keys of any one node. A log must begin before the nodes do, or with a start that asks all.
    """

    def __init__(self, nodes: Iterable[int], reading: Reading, keys: Keys | None) -> None:
        """``nodes``: those of the site; a key file tells of tools too."""
        self.mark: SealMark | None = None
        self._nodes = frozenset(nodes) if keys is None else frozenset((*keys.pairs, keys.node))
        self._reading, self._keys = reading, keys
        self._channels: dict[str, SealMarks] = {}
        #: Frames in the order of the log that wait for a mark: theirs, or that of one before them.
        self._order: deque[tuple[RawFrame, Frame | None]] = deque()
        self._marks: dict[int, SealMark | None] = {}

    def counting(self, frame: RawFrame) -> Iterator[RawFrame]:
        """The frames that are known to count by now, at the time of this one."""
        classic = frame.classic()
        if classic is None:
            yield frame
            return
        marks = self._of(frame.channel)
        marks.hear(classic, frame.time_us)
        for one in marks.counting:
            yield frame._replace(
                can_id=one.arbitration_id,
                data=one.data,
                is_extended=one.is_extended,
                is_remote=one.is_remote,
                is_error=one.is_error,
                remote_dlc=one.remote_dlc,
            )

    def marked(self, frames: Iterable[RawFrame]) -> Iterator[RawFrame]:
        """All frames in their order, each once its mark is known: ``mark``, None for what no seal is about."""
        for raw in frames:
            classic = raw.classic()
            self._order.append((raw, classic))
            if classic is not None:
                for frame, mark in self._of(raw.channel).hear(classic, raw.time_us):
                    self._marks[id(frame)] = mark
            yield from self._ready()
        self.end(self._marks)
        yield from self._ready()

    def end(self, marked: dict[int, SealMark | None] | None = None) -> None:
        """The log is over: what still waits has no seal; ``marked`` takes marks by the ``id`` of their frames."""
        for marks in self._channels.values():
            for frame, mark in marks.end():
                if marked is not None:
                    marked[id(frame)] = mark

    def _ready(self) -> Iterator[RawFrame]:
        while self._order:
            raw, classic = self._order[0]
            if classic is not None and id(classic) not in self._marks:
                return
            self._order.popleft()
            self.mark = None if classic is None else self._marks.pop(id(classic))
            yield raw

    def _of(self, channel: str) -> SealMarks:
        marks = self._channels.get(channel)
        if marks is None:
            group = None if self._keys is None else self._keys.group
            marks = self._channels[channel] = SealMarks(self._nodes, self._reading, group)
        return marks

    def counts(self) -> Counter[tuple[int, SealMark]]:
        """Frames by sender and mark, of all channels."""
        return sum((one.counts for one in self._channels.values()), Counter[tuple[int, SealMark]]())

    def lines(self, name: Callable[[int], str]) -> list[str]:
        """A line for each node with its frames by mark; with keys also one for each that did not count."""
        counts = self.counts()
        told = [
            f"seals: {name(node)}: "
            + ", ".join(f"{counts[node, mark]} {mark.value}" for mark in SealMark if counts[node, mark])
            for node in sorted({node for node, _ in counts})
        ]
        if self._keys is None:
            return told
        wrong = [
            f"seals: {count} under {name(node)}'s number {_WRONG[mark]}"
            for (node, mark), count in sorted(counts.items(), key=lambda one: (one[0][0], one[0][1].value))
            if mark in _WRONG
        ]
        return told + (wrong or ["seals: every frame counted"])


def proof_of(args: argparse.Namespace, site: Site | None) -> LogProof | None:
    """What tells of a log's seals; None where the site has none. Raises ``TraceError``, ``ConfigError``."""
    if site is None or site.seals == "off":
        if args.keys is not None:
            raise TraceError(f"--keys {args.keys}: needs --site with the file of a site that has seals")
        return None
    keys = None if args.keys is None else load_keys(args.keys, site)
    return LogProof(site.machines, codecs_for(site).fleet.decode_part, keys)
