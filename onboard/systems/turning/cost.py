"""What a turned part costs: the five terms of Pujo et al. 2006, section 2.3 (row P26), for one part of a batch."""

from typing import NamedTuple


class Bill(NamedTuple):
    """The five terms, EUR for one part."""

    machining_eur: float
    tools_eur: float
    setup_eur: float
    material_eur: float
    latency_eur: float

    @property
    def total_eur(self) -> float:
        """The sum of its five terms, in EUR."""
        return sum(self)

    @property
    def total_cents(self) -> int:
        """The sum as a bid says it, rounded to the nearest cent."""
        return round(self.total_eur * 100)


class ToolEdgeUse(NamedTuple):
    """Use of one tool's edge: price, minutes cut for one part, minutes that an edge lives."""

    price_eur: float
    cut_min: float
    life_min: float


def bill(
    hourly_eur: float,
    machining_min: float,
    edges: tuple[ToolEdgeUse, ...],
    setup_min: float,
    batch: int,
    material_eur: float,
    latency_min: float,
    wasted_eur: float = 0.0,
) -> Bill:
    """The five terms. ``setup_min`` is shared by the batch; ``latency_min`` is loading and unloading of one part.

    ``wasted_eur`` is what edges changed before they are worn out still were worth, for the whole batch.
    """
    worn_eur = sum(edge.price_eur * edge.cut_min / edge.life_min for edge in edges)
    return Bill(
        machining_eur=hourly_eur * machining_min / 60,
        tools_eur=worn_eur + wasted_eur / batch,
        setup_eur=hourly_eur * setup_min / 60 / batch,
        material_eur=material_eur,
        latency_eur=hourly_eur * latency_min / 60,
    )
