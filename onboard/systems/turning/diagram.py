"""A turning cell over time: a row a lathe, a bar for each order, light while it is set up for, dark while it turns."""

from onboard.contract.messages import Message, Reference
from onboard.contract.turning import LathePhase
from onboard.history.history import Fact
from onboard.systems.turning.history import ProgressTold
from onboard.systems.turning.site import Turning
from onboard.trace.chart.over_time import Bar, Panel, Rows

_OPACITY = {LathePhase.SETTING_UP: 0.22, LathePhase.TURNING: 0.55}


class TurningDiagram(Rows):
    """Orders by what lathes say of their progress."""

    legend = "light bar: sets up for an order; dark bar: turns it"

    def __init__(self, site: Turning, from_us: int | None, until_us: int | None) -> None:
        super().__init__(site, from_us, until_us)
        self._rows = {node: row for row, node in enumerate(site.lathes)}
        self._panel = Panel("lathes", [lathe.name for lathe in site.lathes.values()])
        self.panels = [self._panel]
        self._open: dict[tuple[int, Reference], tuple[LathePhase, int]] = {}

    def take(self, message: Message, fact: Fact | None, time_us: int) -> None:
        """A lathe tells how far an order is."""
        if not isinstance(fact, ProgressTold) or not fact.is_news:
            return
        key = fact.word.sender, fact.task
        self._close(key, time_us)
        if fact.word.lathe_phase in _OPACITY:
            self._open[key] = fact.word.lathe_phase, time_us

    def _close(self, key: tuple[int, Reference], time_us: int) -> None:
        phase, since_us = self._open.pop(key, (LathePhase.FINISHED, 0))
        if phase in _OPACITY:
            row = self._rows[key[0]]
            text = self.words.thing(key[1])
            self._panel.bars.append(Bar(key[0], row - 0.4, row + 0.4, since_us, time_us, text, _OPACITY[phase]))

    def end(self, time_us: int) -> None:
        """Orders in hand are so to the end."""
        for key in list(self._open):
            self._close(key, time_us)


DIAGRAM = TurningDiagram
