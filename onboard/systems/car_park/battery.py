"""What a site file says of its robots' batteries: what they hold, what work draws, and where robots are charged.

A *charger* is a segment: a robot that stands there is charged. Places of a class with ``charging`` are something else:
there customers' cars charge.
"""

from dataclasses import dataclass

from onboard.core.site import Segment

#: Of a full battery, as gauges tell a charge.
FULL_PERMILLE = 1000


@dataclass(frozen=True, slots=True)
class Battery:
    """One battery, the same in every robot of a site; W, Wh, and percent of the capacity.

    ``rest_w`` is drawn always; to it comes ``drive_w`` while the carrier drives or turns, ``loaded_drive_w`` in its
    stead with a car aboard, and ``shuttle_w`` while the shuttle is out. ``charge_w`` flows in at a charger.

    Below ``floor_percent`` a robot charges first, and bids for nothing until it has ``ready_percent``; below
    ``seek_percent`` one that has nothing to do goes to a charger.
    """

    capacity_wh: int
    drive_w: int
    loaded_drive_w: int
    shuttle_w: int
    rest_w: int
    charge_w: int
    floor_percent: int
    ready_percent: int
    seek_percent: int
    #: In the order of the file.
    chargers: tuple[Segment, ...]
