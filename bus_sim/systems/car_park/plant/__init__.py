"""The plant: what moves, holds, opens and senses on a simulated site, and the people who use it.

It talks to controllers only through the device messages of ``dbc/device.dbc``. It is event-driven: motion is in closed
form, and a timer is set only for the next thing that somebody could notice.
"""
