"""An asyncio event loop whose clock is a number: virtual time in whole microseconds, as fast as possible or paced.

Nothing in here sleeps unless a pace is set or the outside world (a socket, a worker thread) is waited for. Timers fire
in the order of (time, sequence of setting); asyncio's own heap compares times only and so does not keep that order.
Each timer is followed by everything that it made ready before the next timer of the same time fires.
"""

