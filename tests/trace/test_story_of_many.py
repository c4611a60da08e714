"""Customers' stories of a busy site: whoever waited, the parts are the whole wait, whatever was lost of the log."""

from functools import cache
from itertools import pairwise
from pathlib import Path
from random import Random

from hypothesis import given, settings
from hypothesis import strategies as st

from bus_sim.cli import main as bus_sim
from onboard.contract.codes import TaskPhase
from onboard.contract.messages import CallForProposals, TaskReport
from onboard.history.calls import is_task
from onboard.trace.listener import LoggedMessage
from onboard.trace.story.why import TaskStory, WaitingStory
from tests.once import once
from tests.trace.runs import SITE, fleet_of

#: More cars than two robots keep up with, a robot and a lift that lose their power, and frames that are missed.
BUSY = ("run", "small", "--random", "50", "20", "--cars", "7", "--seed", "3", "--speed", "max")
FAULTS = ("crash:target=MR1,at_s=130", "crash:target=ER2,at_s=300", "omission:receivers=12,probability=0.01,seed=5")


@cache
def busy() -> list[LoggedMessage]:
    """All messages of the fleet bus of that run."""
    faults = [word for fault in FAULTS for word in ("--fault", fault)]

    def play(folder: Path) -> None:
        assert bus_sim([*BUSY, *faults, "--trace", str(folder / "run.log")]) in (0, 1)

    return fleet_of(once("stories", play) / "run.log")


def told(said: list[LoggedMessage]) -> dict[str, TaskStory]:
    """Every story, by its task."""
    why = WaitingStory(SITE)
    for one in said:
        why.feed(one.message, one.time_us)
    why.finish()
    return {str(task): story for task, story in why.tasks.items()}


def check(story: TaskStory, last_us: int) -> None:
    """Every moment from the call to the end is in exactly one part, and no part is empty or without a word."""
    end_us = story.end_us if story.end_us is not None else story.parts[-1].end_us if story.parts else story.begin_us
    assert end_us <= last_us
    assert sum(part.length_us for part in story.parts) == story.waited_us == end_us - story.begin_us
    assert all(one.end_us == two.begin_us for one, two in pairwise(story.parts))
    assert all(part.length_us > 0 and part.cause.what for part in story.parts)
    assert not story.parts or story.parts[0].begin_us == story.begin_us


def test_the_parts_are_the_whole_wait_of_every_customer_of_a_busy_site() -> None:
    said = busy()
    stories = told(said)
    calls: dict[str, int] = {}
    for one in said:
        if isinstance(one.message, CallForProposals) and is_task(one.message):
            calls.setdefault(str(one.message.task), one.time_us)
    ends = [one for one in said if isinstance(one.message, TaskReport) and one.message.phase is TaskPhase.DONE]
    assert {name: story.begin_us for name, story in stories.items()} == calls and len(calls) >= 14
    done: dict[str, int] = {}
    for one in ends:
        assert isinstance(one.message, TaskReport)
        done.setdefault(str(one.message.task), one.time_us)
    served = {name: story.end_us for name, story in stories.items() if story.phases.get(TaskPhase.DONE)}
    assert served == {name: time_us for name, time_us in done.items() if name in stories} and len(served) >= 14
    for story in stories.values():
        check(story, said[-1].time_us)
    spent = [part.cause.what for story in stories.values() for part in story.parts]
    assert any("started anew" in what for what in spent), "the robot's crash is somebody's cause"


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 1 << 30), kept=st.floats(0.2, 1.0), cut=st.floats(0.1, 1.0))
def test_so_they_are_of_a_log_with_holes(seed: int, kept: float, cut: float) -> None:
    chance = Random(seed)
    said = [one for one in busy()[: max(1, int(len(busy()) * cut))] if chance.random() < kept]
    for story in told(said).values():
        check(story, said[-1].time_us)
