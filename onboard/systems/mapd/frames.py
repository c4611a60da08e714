"""Every frame that the machines of this system send beyond those of all, on both buses."""

from onboard.contract.packing import mapd, mapd_device

FRAMES = (*mapd.FRAMES, *mapd_device.FRAMES)
#: By what builds of different days are strangers.
WORDS = mapd.WORDS
