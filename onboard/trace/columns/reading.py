"""A whole log by columns, whatever its format."""

from collections.abc import Iterator

from onboard.trace.columns.block import FrameBlock, block_of
from onboard.trace.columns.candump_text import read_block
from onboard.trace.readers.candump import read_candump
from onboard.trace.readers.open_log import Log, LogText


def blocks_of(log: Log) -> Iterator[FrameBlock]:
    """All frames of a log, some ten thousand at a time; what is wrong with it is counted in ``log.faults``."""
    for stretch in log.stretches():
        if not isinstance(stretch, LogText):
            block = block_of(stretch)
            block.count(log.faults)
            yield block
        elif stretch.is_whole:
            yield read_block(stretch.lines, stretch.first, log.faults)
        else:
            # A line without its end gives no frame.
            list(read_candump([stretch.lines], log.faults, stretch.first))
