"""Machines so fast that a car is in and out again in a minute and a half: where virtual time does not hurry."""

#: Added to a site's text.
QUICK = """
[carrier]
speed_mm_s = 6_000
acceleration_mm_s2 = 6_000
[shuttle]
speed_mm_s = 5_000
acceleration_mm_s2 = 5_000
[lift]
speed_mm_s = 3_000
acceleration_mm_s2 = 3_000
[timing]
door_ms = 500
grip_ms = 300
"""
