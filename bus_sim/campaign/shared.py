"""Crash points of one scene that share its beginning: it is played once, each point goes on in a process of its own.

At a chosen frame or journal write the process of the scene is copied (``os.fork``); the power fails in the copy, which
plays to its end and answers over a pipe, and the scene goes on as if nothing had been. What comes of a point is what
comes of it played alone from the start (``runner.run_point``): the scene is set up as for any one of them, with a
fault to come, and until that strikes nothing differs. A run writes no file, and its journals are in memory.
"""

import contextlib
import multiprocessing
import os
import signal
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from multiprocessing.connection import Connection, wait
from types import FrameType
from typing import Any, NamedTuple, NoReturn

from bus_sim.campaign.limits import WallLimitError, end_after, event_limit, wall_limit_s
from bus_sim.campaign.report import RunVerdict, TrialReport
from bus_sim.campaign.trial import HANGS, hung, play_stage
from bus_sim.faults.arm import actions_for, arm
from bus_sim.faults.controllers import lose_power
from bus_sim.faults.injection import Injection
from bus_sim.faults.scenario import FaultScenario
from bus_sim.options import RunOptions
from bus_sim.run import BusRun
from bus_sim.sites import find_site
from bus_sim.systems.registry import simulated_of
from bus_sim.virtual_time import VirtualTimeLoop, run_on
from onboard.core.frame import Frame


class Crash(NamedTuple):
    """One point: its number, and a crash at a frame or a write that is counted from power-up on."""

    number: int
    fault: Injection


class PointAnswer(NamedTuple):
    """What came of a point."""

    number: int
    report: TrialReport


def can_share() -> bool:
    """Whether a process can be copied here."""
    return hasattr(os, "fork")


def is_shared(fault: Injection) -> bool:
    """Whether it is a crash that waits from power-up on for a frame or a write, after which the power comes back."""
    waits = fault.kind == "crash" and bool(fault.count("frame") or fault.count("write"))
    return waits and fault.at_us == 0 and fault.text("restart") == "yes"


def play_shared(
    scenario: FaultScenario, crashes: Sequence[Crash], usual_wait_s: float | None, jobs: int
) -> Iterator[PointAnswer]:
    """All points of a scene, as they come in, ``jobs`` at a time.

    ``scenario``: the scene without a fault. Raises ``RuntimeError`` where the process of the scene failed.
    """
    # A fresh interpreter without threads: nothing that this process has done can reach a trial, and it may be copied.
    context = multiprocessing.get_context("spawn")
    answers, there = context.Pipe(duplex=False)
    process = context.Process(target=_play_scene, args=(there, scenario, crashes, usual_wait_s, jobs), daemon=True)
    process.start()
    there.close()
    open_numbers = {one.number for one in crashes}
    try:
        while open_numbers:
            try:
                answer: PointAnswer = answers.recv()
            except EOFError:
                process.join()
                said = f"the scene ended with status {process.exitcode}, and {len(open_numbers)} points are open"
                raise RuntimeError(said) from None
            open_numbers.discard(answer.number)
            yield answer
    finally:
        process.terminate()
        process.join()
        answers.close()


def _play_scene(
    there: Connection, scenario: FaultScenario, crashes: Sequence[Crash], usual_wait_s: float | None, jobs: int
) -> None:
    """The process of the scene; a copy of it never comes back from here."""
    copies = Copies(scenario, jobs, there)

    def end(_number: int, _frame: FrameType | None) -> None:
        # Not by an exception: it would end in whichever machine's task is running, and be told there.
        copies.end()
        os._exit(1)

    signal.signal(signal.SIGTERM, end)
    try:
        report = _play(scenario, crashes, usual_wait_s, copies)
        if copies.mine is None:
            # Those that never came: the power did not fail, and what came of the scene came of them.
            for crash in crashes:
                if crash.number not in copies.made:
                    there.send(PointAnswer(crash.number, _of(report, scenario, crash)))
            copies.collect(most=0)
        else:
            copies.answer(_of(report, scenario, copies.mine))
    except BaseException:  # below a copy is the stack of what it was copied from: nothing may pass
        if copies.mine is not None:
            sys.excepthook(*sys.exc_info())
            os._exit(1)
        raise
    finally:
        copies.end()
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _of(report: TrialReport, scenario: FaultScenario, crash: Crash) -> TrialReport:
    return replace(report, scenario=scenario.with_faults([crash.fault]))


def _play(
    scenario: FaultScenario, crashes: Sequence[Crash], usual_wait_s: float | None, copies: "Copies"
) -> TrialReport:
    """The scene, or in a copy the point; set up as ``trial.play`` does for one of them."""
    site = find_site(scenario.site)
    # Any of them: until it strikes all are the same, and none has an end by itself.
    scenario = scenario.with_faults([crashes[0].fault])
    loop = VirtualTimeLoop()
    loop.event_limit = event_limit(scenario.limit_s)

    async def main() -> TrialReport:
        stage = simulated_of(site).stage(site, RunOptions(seed=scenario.seed, demand=scenario.demand), loop)
        actions = {**actions_for(site), "crash": lambda run, _: Moments(run, crashes, copies).watch()}
        arm(stage.run, scenario.faults, actions)
        return await play_stage(stage, scenario, usual_wait_s, loop)

    try:
        return run_on(loop, main())
    except (WallLimitError, *HANGS) as hang:
        return hung(scenario, loop, hang)


class Moments:
    """Counts the frames and writes of all machines from now on; at those that are chosen a copy of the process ends."""

    def __init__(self, run: BusRun[Any], crashes: Sequence[Crash], copies: "Copies") -> None:
        self._run = run
        self._copies = copies
        #: By machine and what is counted, and by number.
        self._chosen: dict[tuple[str, str], dict[int, list[Crash]]] = defaultdict(lambda: defaultdict(list))
        for one in crashes:
            what = "frame" if one.fault.count("frame") else one.fault.text("durable")
            number = one.fault.count("frame") or one.fault.count("write")
            self._chosen[one.fault.target, what][number].append(one)
        self._counts: dict[tuple[str, str], int] = defaultdict(int)

    def watch(self) -> None:
        """Count frames and journal writes from now on, and fork at each moment that was chosen."""
        for medium in (self._run.fleet, *self._run.devices.values()):
            medium.tap_queues(self._on_queue)
        for node, journal in self._run.journals.items():
            journal.on_write = self._on_write(self._run.site.machines[node].name)

    def _on_queue(self, _frame: Frame, _time_us: int, sender: str) -> None:
        self._count(sender, "frame")

    def _on_write(self, name: str) -> Callable[[bool], None]:
        return lambda is_durable: self._count(name, "yes" if is_durable else "no")

    def _count(self, name: str, what: str) -> None:
        if self._copies.mine is not None:
            return
        self._counts[name, what] += 1
        for crash in self._chosen[name, what].get(self._counts[name, what], ()):
            if self._copies.copy(self._run.loop, crash):
                lose_power(self._run, crash.fault)
                return


class Copies:
    """Processes that go on from here, ``jobs`` of them at a time; ``to`` is told their answers."""

    def __init__(self, scenario: FaultScenario, jobs: int, to: Connection) -> None:
        #: In a copy: the point that it plays.
        self.mine: Crash | None = None
        self.made: set[int] = set()
        self._scenario = scenario
        self._jobs = jobs
        self._to = to
        self._running: dict[Connection, tuple[int, Crash]] = {}

    def copy(self, loop: VirtualTimeLoop, crash: Crash) -> bool:
        """Whether this is the copy."""
        self.collect(most=self._jobs - 1)
        self.made.add(crash.number)
        here, there = multiprocessing.Pipe(duplex=False)
        process = os.fork()
        if process:
            there.close()
            self._running[here] = (process, crash)
            return False
        # A person's interrupt goes to all of them: the process of the scene ends its copies.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        for other in (self._to, here, *self._running):
            other.close()
        self._running.clear()
        self.mine, self._to = crash, there
        loop.go_on_in_copy()
        end_after(wall_limit_s(self._scenario.limit_s))
        return True

    def answer(self, report: TrialReport) -> NoReturn:
        """End the copy with this; where nobody waits for it any more, too."""
        with contextlib.suppress(BrokenPipeError):
            self._to.send(report)
        os._exit(0)

    def collect(self, *, most: int) -> None:
        """Pass answers on until at most so many run."""
        while len(self._running) > most:
            for here in wait(list(self._running)):
                assert isinstance(here, Connection)
                process, crash = self._running.pop(here)
                try:
                    report = here.recv()
                except EOFError:
                    report = None
                here.close()
                _, status = os.waitpid(process, 0)
                self._to.send(PointAnswer(crash.number, report or self._without_answer(crash, status)))

    def _without_answer(self, crash: Crash, status: int) -> TrialReport:
        """A program error in a point must not end the campaign: it is a result."""
        error = f"its process ended with status {os.waitstatus_to_exitcode(status)} and no answer"
        return TrialReport(self._scenario.with_faults([crash.fault]), RunVerdict.CRASHED, error=error)

    def end(self) -> None:
        """Whatever still runs is not wanted any more."""
        for here, (process, _) in self._running.items():
            os.kill(process, signal.SIGTERM)
            os.waitpid(process, 0)
            here.close()
        self._running.clear()
