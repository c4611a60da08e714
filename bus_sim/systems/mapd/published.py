"""Service times that others have published for the small warehouse of Ma, Li, Kumar and Koenig (AAMAS 2017)."""

#: Mean steps from release to delivery of Token Passing (TP), by tasks released a step and number of robots.
TOKEN_PASSING: dict[tuple[str, int], float] = {
    ("0.5", 10): 132.8,
    ("0.5", 30): 44.0,
    ("2", 10): 407.6,
    ("2", 30): 114.4,
    ("10", 10): 495.9,
    ("10", 30): 192.0,
}
