"""Every frame that the machines of this system send beyond those of all, on both buses."""

from onboard.contract.packing import car_park, car_park_device

FRAMES = (*car_park.FRAMES, *car_park_device.FRAMES)
#: By what builds of different days are strangers, on sites where these frames are said.
WORDS = car_park.WORDS
#: The field of a site without which nobody says them: they make no strangers where it is not set.
ASKED_BY = "promises"
