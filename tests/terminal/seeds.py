"""A short day at the terminal."""

from bus_sim.sites import site_text
from onboard.config.site import parse_site
from onboard.systems.terminal.site import Terminal
from onboard.systems.terminal.vehicle import terminal

#: "Load S10 with 2 of T1 from A4", "tranship B11 and B12 to S4", and a blocked lane.
SHORT = """
[[missions]]
at_s = 5
load = 2
type = "T1"
from = "A4"
to = "S1"

[[missions]]
at_s = 15
desk = "Quay"
tranship = ["B11", "B12"]
to = "S4"

[[blockages]]
lane = "L11"
at_s = 45
for_s = 60
"""


def short(missions: str = SHORT) -> Terminal:
    """The shipped network with other missions."""
    text = site_text("terminal")
    return terminal(parse_site(text[: text.index('# "Load station')] + missions, "short.toml"))
