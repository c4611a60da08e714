"""Plays scenes one after another: frames and times in, frames and power out. No clock and no bus of its own."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from onboard.conform.cast import Cast
from onboard.conform.checks import Check, Findings, Verdict
from onboard.conform.stage import SECOND, Means, PlatformRun, Play, Stage, Wait
from onboard.core.frame import Frame
from onboard.core.site import Site
from onboard.wire.codec import Codec


class Scene(NamedTuple):
    """``play`` is given the stage and the fleet; its checks are reached in it or not. ``needs`` says what for."""

    name: str
    checks: tuple[Check, ...]
    play: Callable[[Stage, Cast], Play]
    needs_power: bool = False
    needs_car: bool = False
    needs_other: bool = False
    needs_rival: bool = False
    needs_lift: bool = False

    def lacks(self, stage: Stage) -> str:
        """Why it cannot be played; empty where it can."""
        if self.needs_power and not stage.means.power:
            return "nobody switches the node off and on: --power"
        if self.needs_car and not stage.means.has_car:
            return "no car stands in the bay: --car"
        if self.needs_other and not stage.other:
            return "the site has no further machine that the kit could speak as"
        if self.needs_rival and not stage.rival:
            return "the site has no further robot that the kit could speak as"
        if self.needs_rival and stage.lift:
            return "the site has lifts: who passes whom is judged on one floor"
        if self.needs_lift and not stage.lift:
            return "the site has no lift that the kit could speak as"
        return ""


#: What is judged all the time: its checks, and who joins the hearers of a stage to judge them.
Watching = tuple[tuple[Check, ...], Callable[[Stage, Cast], None]]


@dataclass
class Player:
    """One play before one node. ``start`` once; then ``receive`` and ``wake`` with a clock in us that never goes back.

    After each call ``frames`` and ``power`` have what is to be done; whoever does it takes it from there.
    """

    site: Site
    node: int
    codec: Codec
    scenes: Iterable[Scene]
    means: Means = field(default_factory=Means)
    watchers: tuple[Watching, ...] = ()
    tell: Callable[[str], None] = lambda _: None
    #: Whether a scene in which a duty is broken is the last: enough to know that the node is not to be taken.
    stops_at_first: bool = False

    def __post_init__(self) -> None:
        self.scenes = tuple(self.scenes)
        self.findings = Findings()
        for scene in self.scenes:
            self.findings.add(scene.name, scene.checks)
        self.stage = Stage(self.site, self.node, self.codec, self.means, self.findings)
        self.cast = Cast(self.stage)
        for checks, watch in self.watchers:
            self.findings.add("all the time", checks)
            watch(self.stage, self.cast)
        self.is_over = False
        self._play: Play = self._all()
        self._wait = Wait(0)

    def hand_out(
        self,
        send: Callable[[Frame], object],
        switch: Callable[[bool], object],
        move: Callable[[PlatformRun], object] = lambda _: None,
    ) -> None:
        """Switch the node as the play wants it, move platforms, then send what it says, each in its order."""
        for on in self.stage.power:
            switch(on)
        self.stage.power.clear()
        for ride in self.stage.rides:
            move(ride)
        self.stage.rides.clear()
        for frame in self.stage.out:
            send(frame)
        self.stage.out.clear()

    def start(self, now_us: int) -> None:
        """Begin the play at this time, with the fleet still away from the bus."""
        self.stage.now_us = self.stage.begin_us = now_us
        self.cast.is_on = False
        self._wait = Wait(now_us)
        self._go_on()

    def receive(self, frame: Frame, now_us: int) -> None:
        """A frame of the bus that the kit did not send."""
        self.stage.now_us = max(now_us, self.stage.now_us)
        self.stage.hear(frame)
        self._go_on()

    def wake(self, now_us: int) -> None:
        """Do what is due by now, of the fleet and of the scene."""
        self.stage.now_us = max(now_us, self.stage.now_us)
        self.cast.wake()
        self._go_on()

    def next_us(self) -> int:
        """When ``wake`` is wanted next, never before now."""
        return max(self.stage.now_us, min(self._wait.until_us, self.cast.next_us()))

    def _go_on(self) -> None:
        while not self.is_over and (
            self._wait.until_us <= self.stage.now_us or (self._wait.done is not None and self._wait.done())
        ):
            try:
                self._wait = next(self._play)
            except StopIteration:
                self.is_over = True

    def _all(self) -> Play:
        for scene in self.scenes:
            lacks = scene.lacks(self.stage)
            if lacks:
                for check in scene.checks:
                    self.findings.by_name[check.name].why = lacks
                continue
            self.tell(scene.name)
            yield from scene.play(self.stage, self.cast)
            self.cast.reset()
            yield from self.stage.pause(1.0)
            if self.stops_at_first and self.findings.of(Verdict.FAILED):
                break
        yield Wait(self.stage.now_us + SECOND)
        for close in self.stage.closers:
            close()
