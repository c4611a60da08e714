"""Who may order what from afar, by the name that the broker has proved: the last level of the topic of an order."""

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Role:
    """What one giver of orders may have fetched and parked; machines by node-ID.

    ``desks``: at which desks; ``cars``: which cars, by the desk where they came in.
    """

    desks: frozenset[int]
    cars: frozenset[int]


#: By name. Who has no role fetches nothing.
Roles = Mapping[str, Role]
