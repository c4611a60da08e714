"""What is to be taken from where to where, on a floor of pick-up and delivery."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class TransportTask:
    """Take what is in cell ``pickup`` to cell ``delivery``; known from step ``release`` on."""

    number: int
    release: int
    pickup: int
    delivery: int
