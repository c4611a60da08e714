"""Where each load stands, and who carries it."""

from dataclasses import dataclass

from onboard.contract.constants import ANY_STATION, OUTSIDE
from onboard.contract.messages import CarAt, Reference


@dataclass(frozen=True, slots=True)
class LoadTold:
    """A word about a load; ``changed`` are the machines that carry another load by it than before."""

    word: CarAt
    changed: frozenset[int]


class Loads:
    """A fold over words about loads. What has left the site is forgotten."""

    def __init__(self) -> None:
        #: Number of the station, ``ANY_STATION`` for a load that is carried.
        self.stations: dict[Reference, int] = {}
        #: By node-ID.
        self.aboard: dict[int, Reference] = {}

    def standing(self) -> dict[int, Reference]:
        """Loads by the station where they stand."""
        return {station: load for load, station in self.stations.items() if station != ANY_STATION}

    def on_car(self, word: CarAt) -> LoadTold:
        """Take up one word: a load is aboard one machine at most."""
        carrier = word.sender if word.station == ANY_STATION else None
        without = {node for node, load in self.aboard.items() if load == word.car and node != carrier}
        changed = set(without)
        if carrier is not None and self.aboard.get(carrier) != word.car:
            changed.add(carrier)
        for node in without:
            del self.aboard[node]
        if carrier is not None:
            self.aboard[carrier] = word.car
        if word.station == OUTSIDE:
            self.stations.pop(word.car, None)
        else:
            self.stations[word.car] = word.station
        return LoadTold(word, frozenset(changed))
