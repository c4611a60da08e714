"""Service times that others have published for the small warehouse of Ma, Li, Kumar and Koenig (AAMAS 2017)."""

import re

#: Mean steps from release to delivery of Token Passing (TP), by tasks released a step and number of robots.
TOKEN_PASSING: dict[tuple[str, int], float] = {
    ("0.5", 10): 132.8,
    ("0.5", 30): 44.0,
    ("2", 10): 407.6,
    ("2", 30): 114.4,
    ("10", 10): 495.9,
    ("10", 30): 192.0,
}

_NAME = re.compile(r"kiva-(\d+)-500-5_kiva-([\d.]+)")


def token_passing(site_name: str, tasks: int) -> float | None:
    """The published mean for an imported site, by the name that the import gives it; None for any other, or a part."""
    found = _NAME.fullmatch(site_name)
    return TOKEN_PASSING.get((found.group(2), int(found.group(1)))) if found is not None and tasks == 500 else None
