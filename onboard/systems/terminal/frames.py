"""Every frame that the machines of this system send beyond those of all, on both buses."""

from onboard.contract.packing import terminal, terminal_device

FRAMES = (*terminal.FRAMES, *terminal_device.FRAMES)
#: By what builds of different days are strangers.
WORDS = terminal.WORDS
