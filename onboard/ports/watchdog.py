"""What a controller needs of the supervisor that restarts it."""

from typing import Protocol


class Watchdog(Protocol):
    """The supervisor's view of one controller (systemd ``sd_notify`` protocol on a board)."""

    def ready(self) -> None:
        """Tell that start-up is over."""

    def alive(self) -> None:
        """Tell that the controller still makes progress; to be called at least twice in the supervisor's period."""

    def status(self, text: str) -> None:
        """One line for a person."""
