"""Every frame that the machines of this system send beyond those of all, on both buses."""

from onboard.contract.packing import cell, cell_device

FRAMES = (*cell.FRAMES, *cell_device.FRAMES)
#: By what builds of different days are strangers.
WORDS = cell.WORDS
