"""The commands of ``bus-sim``: each is loaded only where it is the one that is asked for, and starts as soon."""

from collections.abc import Callable
from types import ModuleType
from typing import NamedTuple

#: What the help of ``bus-sim`` and of its first command ends with.
HELP = """\
exit status:
  0  everything that was asked for happened, and no invariant was broken
  1  the run failed: an invariant of the plant broke, a controller halted, or somebody was left waiting
  2  a mistake in the command line or in a file; one line for each says where and what to do

examples:
  bus-sim run                          an hour of a real day on the standard site, a minute a second
  bus-sim run standard                 that whole day, as fast as possible
  bus-sim run standard --hour 16:30    from 16:30 to 17:30, after a short hurried warm-up
  bus-sim run level1                   a day on the one-floor site
  bus-sim run level1 --one-car 300     one car by hand, fetched after five minutes
  bus-sim run small --by-hand          press i for a car in, o for a car out
  bus-sim run level1 --serve           at the pace of the clock, the fleet bus on 127.0.0.1:29536 (socketcand)
  bus-sim run level1 --bus socketcan:vcan0
                                       the fleet bus on an interface, so that `candump vcan0` shows it
  bus-sim run small --processes --one-car 60
                                       every machine in a process of its own, at the pace of the clock
  bus-sim run small --mqtt             publish it to a broker of its own; prints how to watch with mosquitto_sub
  bus-sim dbc level1 > level1.dbc      one message for each machine, for candump | cantools decode, Wireshark ...
"""


class OptionError(ValueError):
    """A mistake in one option: its name, the value and the remedy in one line."""


class Command(NamedTuple):
    """A command's line in the help of ``bus-sim``, and how the module that has the rest of it is loaded.

    The module's ``add_options`` gives a parser its options and description; its ``run`` does what they say, and returns
    the exit status.
    """

    summary: str
    load: Callable[[], ModuleType]
