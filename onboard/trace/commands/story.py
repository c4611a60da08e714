"""``onboard trace calls`` and ``onboard trace why``: what was dealt out, and what a customer waited for."""

import argparse
import sys

from onboard.config.arguments import whole
from onboard.contract.messages import Reference
from onboard.core.site import Site
from onboard.history.history import History
from onboard.systems.contract import codecs_for
from onboard.trace.commands.common import (
    Commands,
    TraceError,
    add_command,
    add_log,
    add_site,
    open_log,
    site_of,
    tell_faults,
)
from onboard.trace.listener import Listener
from onboard.trace.story.calls import call_lines
from onboard.trace.story.why import TaskStory, WaitingStory, task_lines
from onboard.trace.words import Words

CALLS_HELP = """\
Times are seconds since the first frame of the log.

examples:
  onboard trace calls run.log --site bus_sim/sites/small.toml
  onboard trace calls run.log --site bus_sim/sites/small.toml --task IOC1/2
"""
WHY_HELP = """\
TASK is CALLER/NUMBER as `onboard trace calls` names it; without one the longest waits are listed. Waiting is from the
task's call to the report that it is done; each moment of it belongs to one part, so the parts sum to it.

examples:
  onboard trace why run.log IOC1/2 --site bus_sim/sites/small.toml
  onboard trace why run.log --site bus_sim/sites/small.toml
"""


def register_calls(commands: Commands) -> None:
    """Add ``calls`` to the commands of ``onboard trace``, with its options."""
    parser = add_command(commands, "calls", "every call: bids, winner, promise, finish", CALLS_HELP, run_calls)
    add_log(parser)
    add_site(parser)
    parser.add_argument("--task", metavar="TASK", help="only calls for this task, such as IOC1/2")


def register_why(commands: Commands) -> None:
    """Add ``why`` to the commands of ``onboard trace``, with its options."""
    parser = add_command(commands, "why", "what one customer waited for, on whom, for how long", WHY_HELP, run_why)
    add_log(parser)
    parser.add_argument("task", nargs="?", metavar="TASK", help="such as IOC1/2; default: list the longest waits")
    add_site(parser, required=True)


def run_calls(args: argparse.Namespace) -> int:
    """Print every call of the log, or those for one task. Raises ``TraceError`` for systems without calls."""
    site = site_of(args)
    task = task_of(args.task, site)
    listener, words = Listener(codecs_for(site)), Words(site)
    history = History(site, is_bounded=False)
    start_us: int | None = None
    with open_log(args) as log:
        for said in listener.messages(log):
            start_us = said.time_us if start_us is None else start_us
            if said.is_fleet:
                words.hear(said.message)
                history.feed(said.message, said.time_us)
                done = words.system.finished(said.message)
                if done is not None:
                    history.calls.finish(done, said.time_us)
    shown = [call for call in history.calls.all if task is None or call.terms.task == task]
    for call in shown:
        print("\n".join(call_lines(call, words, start_us or 0)))
    print(f"{len(shown)} calls, {sum(len(call.bids) for call in shown)} bids")
    sys.stdout.flush()
    tell_faults(log, listener)
    return 0


def run_why(args: argparse.Namespace) -> int:
    """Print the story of a task, or the list of all."""
    site = site_of(args)
    assert site is not None, "argparse asks for it"
    task = task_of(args.task, site)
    words = Words(site)
    listener, why = Listener(codecs_for(site)), WaitingStory(site, words)
    start_us: int | None = None
    with open_log(args) as log:
        for said in listener.messages(log):
            start_us = said.time_us if start_us is None else start_us
            if said.is_fleet:
                why.feed(said.message, said.time_us)
    why.finish()
    if task is None:
        for story in sorted(why.tasks.values(), key=lambda one: -one.waited_us):
            print(_line(story, words))
    elif task not in why.tasks:
        known = ", ".join(words.reference(one) for one in list(why.tasks)[:20]) or "none"
        raise TraceError(f"{args.log}: no task {args.task} in it; tasks there: {known}")
    else:
        print("\n".join(task_lines(why.tasks[task], words, start_us or 0)))
    sys.stdout.flush()
    tell_faults(log, listener)
    return 0


def _line(story: TaskStory, words: Words) -> str:
    worst = max(story.parts, key=lambda part: part.length_us, default=None)
    most = "" if worst is None else f"; longest part {worst.length_us / 1e6:.1f} s: {worst.cause.what}"
    what = words.system.operation(story.operation)
    return f"{words.reference(story.task):>10} {what:>9} {story.waited_us / 1e6:8.1f} s{most}"


def task_of(text: str | None, site: Site | None) -> Reference | None:
    """The task that a person names. Raises ``TraceError``."""
    if text is None:
        return None
    caller, _, number = text.partition("/")
    node = next((one.node_id for one in site.machines.values() if one.name == caller), 0) if site is not None else 0
    node, place = node or whole(caller) or 0, whole(number)
    if not node or place is None:
        raise TraceError(f"task {text!r}: write CALLER/NUMBER as `onboard trace calls` names tasks, such as IOC1/2")
    return Reference(node, place)
