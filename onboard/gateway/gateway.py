"""The gateway: frames in, publications out. It listens, and nothing that it does can hold a frame up.

A frame costs its bus one append to a bounded queue. A task of its own decodes and publishes, a few frames at a time
between which everything else on the loop has its turn; each link sends in a task of its own.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Iterable

from onboard.contract.runs import singles
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.gateway.desk import GatewayDesk
from onboard.gateway.link import Link, LinkWords
from onboard.gateway.own_words import OwnWords
from onboard.gateway.publisher import FLEET, Outgoing, Publisher
from onboard.gateway.reports import Reports
from onboard.gateway.settings import GatewaySettings, level
from onboard.ports.broker import Broker, Publication
from onboard.wire.codec import Codec
from onboard.wire.decoder import Decoder

#: Frames that wait to be decoded; of more the oldest is dropped and counted. Ten seconds of a full bus of 500 kbit/s.
MOST_FRAMES = 30_000
#: Frames decoded in one turn of the loop: at 0.1 ms each no other task waits longer than a millisecond or so for it.
TURN = 8


class Gateway:
    """Publishes one site, or one machine of it. ``on_frame`` from the bus; ``run`` is its task, ended by ``stop``.

    ``wall_us`` gives wall time in us since 1970: a board's clock may be set while this runs. ``client`` begins the
    names of its sessions, which must be its own at the broker.
    """

    def __init__(
        self,
        site: Site,
        codec: Codec,
        broker: Broker,
        settings: GatewaySettings,
        *,
        reports: Reports | None = None,
        wall_us: Callable[[], int] | None = None,
        client: str = "onboard",
        send: Callable[[Frame], bool] | None = None,
    ) -> None:
        """With ``send``, which puts a frame on the fleet bus, orders are taken under the settings' node-ID.

        That needs ``reports`` as well.
        """
        self._loop = asyncio.get_running_loop()
        self.frames = 0
        self.frames_dropped = 0
        #: Disk writes of reports that failed; such reports are in memory only.
        self.disk_errors = 0
        self.publisher = Publisher(site, settings, self._now_us())
        self.reports = reports
        self._wall_us = wall_us
        self._decoder = Decoder(codec, site.machines)
        self._inbox: deque[tuple[Frame, int]] = deque()
        self._news = asyncio.Event()
        self._stopping = False
        self._to_keep: deque[tuple[str, Publication]] = deque()
        self._set_clock()
        self.desk: GatewayDesk | None = None
        self.words: OwnWords | None = None
        if send is not None and reports is not None and settings.node_id is not None:
            self.words = OwnWords(codec, settings.node_id, send)
            self.desk = GatewayDesk(site, self.publisher, reports, self.words.say, self._post, self._now_us())
        self.links = {name: self._link(broker, client, name) for name in self.publisher.links}

    # --- in ------------------------------------------------------------------------------------------------------

    def on_frame(self, frame: Frame, time_us: int) -> None:
        """One frame of the fleet bus, at a time of the loop. Never blocks, never raises."""
        self.frames += 1
        if len(self._inbox) >= MOST_FRAMES:
            self._inbox.popleft()
            self.frames_dropped += 1
        self._inbox.append((frame, time_us))
        self._news.set()

    def event(self, time_us: int, source: str, text: str) -> None:
        """``ports.Telemetry``: what a controller in this process says in words, on ``log/MACHINE``."""
        outgoing = {"at": self.publisher.at(time_us), "machine": source, "text": text}
        link = self.links.get(level(source), self.links.get(FLEET))
        if link is not None:
            link.post(self.publisher.publication(f"log/{level(source)}", outgoing))

    def news(self) -> str:
        """The sessions in one line: how many there are, why the others are not, and what was lost."""
        links = list(self.links.values())
        there = sum(link.is_connected for link in links)
        lost = sum(link.counts.dropped for link in links)
        waiting = len(self.reports.pending) if self.reports is not None else 0
        parts = [f"broker: {there} of {len(links)} sessions"]
        parts.append(next((link.trouble for link in links if link.trouble), ""))
        parts.append(f"{lost} telemetry dropped" if lost else "")
        parts.append(f"{waiting} reports wait" if waiting else "")
        kept_back = self.words.kept_back if self.words is not None else 0
        parts.append(f"{kept_back} messages not its own kept off the bus" if kept_back else "")
        return "; ".join(part for part in parts if part)

    def stop(self) -> None:
        """End ``run``: links say goodbye."""
        self._stopping = True
        self._news.set()

    # --- the task ------------------------------------------------------------------------------------------------

    async def run(self) -> None:
        """Open all sessions and publish what is due, until ``stop`` is called."""
        links = [asyncio.ensure_future(link.run()) for link in self.links.values()]
        try:
            while not self._stopping:
                self._news.clear()
                await self._work_off()
                await self._wait()
        except asyncio.CancelledError:
            # As if the power were cut: no goodbyes.
            for task in links:
                task.cancel()
            raise
        finally:
            for link in self.links.values():
                link.stop()
            await asyncio.gather(*links, return_exceptions=True)

    async def _work_off(self) -> None:
        """Decode and publish what waits, in turns."""
        while self._inbox:
            for _ in range(min(TURN, len(self._inbox))):
                frame, time_us = self._inbox.popleft()
                message = self._decoder.feed(frame, time_us)
                for word in singles(message) if message is not None else ():
                    fact = self.publisher.history.feed(word, time_us)
                    self._post(self.publisher.take(word, fact, time_us))
                    if self.desk is not None:
                        await self.desk.feed(fact, time_us)
            await self._keep_reports()
            await asyncio.sleep(0)
        now_us = self._now_us()
        if self.publisher.next_wake() <= now_us:
            self._set_clock()
            self._post(self.publisher.wake(now_us))
        if self.desk is not None:
            await self.desk.work(now_us)
            await self._keep_reports()

    async def _wait(self) -> None:
        """Until something is heard or due."""
        due_us = self.desk.next_wake() if self.desk is not None else None
        next_us = self.publisher.next_wake() if due_us is None else min(due_us, self.publisher.next_wake())
        rest_s = (next_us - self._now_us()) / 1e6
        timer = self._loop.call_later(max(0.0, rest_s), self._news.set)
        await self._news.wait()
        timer.cancel()

    def _post(self, outgoing: Iterable[Outgoing]) -> None:
        for one in outgoing:
            if one.report and self.reports is not None:
                self._to_keep.append((one.report, one.publication))
            elif one.link in self.links:
                self.links[one.link].post(one.publication)

    async def _keep_reports(self) -> None:
        """Terminal reports go to the disk before they go to the broker; this task waits for it, and nothing else."""
        while self._to_keep and self.reports is not None:
            name, publication = self._to_keep.popleft()
            try:
                await self.reports.take(name, publication)
            except OSError:
                self.disk_errors += 1
            self.links[FLEET].wake()

    # --- inner works -------------------------------------------------------------------------------------------

    def _link(self, broker: Broker, client: str, name: str) -> Link:
        publisher = self.publisher
        words = LinkWords(
            lambda: publisher.will(name, self._now_us()),
            lambda: publisher.hello(name, self._now_us()),
            lambda: publisher.goodbye(name, self._now_us()),
        )
        if name != FLEET:
            return Link(broker, f"{client}-{name}", words)
        subscriptions = self.desk.inbox.subscriptions if self.desk is not None else ()
        return Link(
            broker,
            f"{client}-fleet",
            words,
            reports=self.reports,
            subscriptions=subscriptions,
            on_order=self._on_order,
        )

    def _on_order(self, publication: Publication, taken: Callable[[], None]) -> None:
        if self.desk is not None:
            self.desk.on_publication(publication, taken)
            self._news.set()

    def _set_clock(self) -> None:
        if self._wall_us is not None:
            self.publisher.set_epoch(self._wall_us() - self._now_us())

    def _now_us(self) -> int:
        return round(self._loop.time() * 1_000_000)
