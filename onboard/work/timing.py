"""Times of a site's devices beside those of the protocol."""

from dataclasses import dataclass

from onboard.core.site import Timing


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceTiming(Timing):
    """How long a door takes to open or close, and a gripper to grip, in microseconds; every site file may say it."""

    door_us: int
    grip_us: int
