"""Which frames of a log counted on its bus, by their seals."""

from collections import Counter
from collections.abc import Callable, Iterator

from onboard.contract.seal import SealWord
from onboard.seal.keys import Keys
from onboard.seal.listener import SealListener
from onboard.seal.subjects import Reading
from onboard.trace.raw import RawFrame

_WORDS = {
    SealWord.UNSEALED: "without a seal",
    SealWord.FALSE_SEAL: "false seals",
    SealWord.REPLAYED: "said again",
    SealWord.NOT_FRESH: "under a number that the log does not tell",
}


class LogProof:
    """By the group key of one node's file. A log must begin before the nodes do, or with a start that asks all."""

    def __init__(self, keys: Keys, reading: Reading) -> None:
        self._keys, self._reading = keys, reading
        self._channels: dict[str, SealListener] = {}

    def counting(self, frame: RawFrame) -> Iterator[RawFrame]:
        """The frames that are known to count by now, at the time of this one."""
        classic = frame.classic()
        if classic is None:
            yield frame
            return
        listener = self._channels.get(frame.channel)
        if listener is None:
            nodes = (*self._keys.pairs, self._keys.node)
            listener = self._channels[frame.channel] = SealListener(self._keys.group, nodes, self._reading)
        for one in listener.proved(classic, frame.time_us):
            yield frame._replace(
                can_id=one.arbitration_id,
                data=one.data,
                is_extended=one.is_extended,
                is_remote=one.is_remote,
                is_error=one.is_error,
                remote_dlc=one.remote_dlc,
            )

    def lines(self, name: Callable[[int], str]) -> list[str]:
        """What did not count, a line for each node and what was wrong."""
        faults = sum((one.faults for one in self._channels.values()), Counter[tuple[int, SealWord]]())
        told = [
            f"seals: {count} under {name(node)}'s number {_WORDS[what]}"
            for (node, what), count in sorted(faults.items())
        ]
        return told or ["seals: every frame counted"]
