"""Terminal reports: kept on disk until the broker has them, told once in effect.

Each has a name. A report whose name is known is not taken again, however often the bus repeats it and however often
the gateway is started; who reads them tells twins by ``id``, for a broker that is killed may have passed one on
without a word (MQTT's QoS 1: at least once).
"""

import base64
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator

from onboard.core.journal_records import records_in
from onboard.gateway.records import DeliveredRecord, ReportRecord
from onboard.ports.broker import Publication
from onboard.ports.journal import Entry, Journal

#: Reports that wait for a broker; of more the oldest is given up and counted. At 400 bytes each 8 MB.
MOST_PENDING = 20_000
#: Names remembered after delivery: more than a site ends tasks in the time for which the bus repeats one.
MOST_KNOWN = 4_096
#: The journal is written anew when it holds so many records beyond those that count.
SLACK_RECORDS = 2_000


class Reports:
    """The reports of one gateway. ``journal`` is replayed here; other records in it are ``others``, oldest first."""

    def __init__(self, journal: Journal) -> None:
        self.given_up = 0
        #: Records of others in the journal as they were found, oldest first.
        self.others: list[Entry] = []
        #: What of them counts when the journal is written anew.
        self.keep: Callable[[], Iterable[Entry]] = lambda: self.others
        self.pending: OrderedDict[str, Publication] = OrderedDict()
        self._known: OrderedDict[str, None] = OrderedDict()
        self._journal = journal
        self._records = 0
        #: Records that counted when the journal was last written anew.
        self._kept = 0
        for entry in journal.replay():
            self._records += 1
            match next(records_in([entry], ReportRecord, DeliveredRecord), None):
                case ReportRecord() as report:
                    self._take(report.name, _publication(report))
                case DeliveredRecord(name=name):
                    self._done(name)
                case _:
                    self.others.append(entry)

    def is_known(self, name: str) -> bool:
        """Whether a report of this name was taken before."""
        return name in self.pending or name in self._known

    async def take(self, name: str, publication: Publication) -> bool:
        """Keep one report durably; False where its name is known. Raises ``OSError``: it is then in memory only."""
        if self.is_known(name):
            return False
        self._take(name, publication)
        await self.append(_entry(name, publication))
        return True

    async def delivered(self, name: str) -> None:
        """The broker has it. Raises ``OSError``: it may then be sent again after a restart."""
        self._done(name)
        await self.append(DeliveredRecord(name).entry)

    async def append(self, entry: Entry) -> None:
        """One more record, and the journal anew where it has grown too long. Raises ``OSError``."""
        await self._journal.append(entry)
        self._records += 1
        if self._records > SLACK_RECORDS + 2 * self._kept:
            kept = list(self.entries())
            await self._journal.compact(lambda _: kept)
            self._records = self._kept = len(kept)

    def entries(self) -> Iterator[Entry]:
        """What counts, oldest first."""
        yield from self.keep()
        for name in self._known:
            yield DeliveredRecord(name).entry
        for name, publication in self.pending.items():
            yield _entry(name, publication)

    def _take(self, name: str, publication: Publication) -> None:
        self.pending[name] = publication
        if len(self.pending) > MOST_PENDING:
            self.pending.popitem(last=False)
            self.given_up += 1

    def _done(self, name: str) -> None:
        self.pending.pop(name, None)
        self._known[name] = None
        if len(self._known) > MOST_KNOWN:
            self._known.popitem(last=False)


def _entry(name: str, publication: Publication) -> Entry:
    payload = base64.b64encode(publication.payload).decode()
    return ReportRecord(name, publication.topic, payload, publication.retain).entry


def _publication(record: ReportRecord) -> Publication:
    return Publication(record.topic, base64.b64decode(record.payload), 1, record.retain)
