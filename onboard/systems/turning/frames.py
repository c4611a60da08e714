"""Every frame that the machines of this system send beyond those of all, on both buses."""

from onboard.contract.packing import turning, turning_device

FRAMES = (*turning.FRAMES, *turning_device.FRAMES)
#: By what builds of different days are strangers.
WORDS = turning.WORDS
