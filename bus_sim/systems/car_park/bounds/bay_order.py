"""The best that one bay could do with the customers that it had, whatever order it takes them in.

A bay serves one after the other. It is turned to the street (input door open, nobody in it) when a driver comes in, and
to the park (output door open, empty) when his car has been taken; the other way round for a car that goes out. Turning
it takes both doors' time, so two cars of one direction have a turn between them and two of different directions none.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from itertools import count
from typing import NamedTuple

#: So many jobs are looked at for one bay's busy time, all together: about a third of a second.
MOST_STEPS = 150_000


class BayJob(NamedTuple):
    """What one car does with the bay: not before ``release_us``, ``busy_us`` long, in or out."""

    release_us: int
    busy_us: int
    goes_out: bool


def least_ends_us(jobs: Sequence[BayJob], turn_us: int, most_steps: int = MOST_STEPS) -> int:
    """No order of these jobs has a smaller sum of ends, us.

    Jobs before which a bay that never waits has done all others are looked at apart from these: that leaves out that
    they may hinder each other, and no order gets worse by it. Of jobs looked at together it is the exact optimum where
    ``most_steps`` suffice for branch and bound (Land and Doig 1960), else what is proven by then, which is a bound too.
    """
    return sum(_Order(block, turn_us).least_us(most_steps) for block in _blocks(jobs, turn_us))


def preemptive_ends_us(jobs: Sequence[BayJob], from_us: int) -> int:
    """The sum of ends if jobs could be broken off and no turn took time: shortest rest first (Schrage 1968), us.

    No order without breaks is better, as each is one of those that this takes the best of. ``jobs`` are in the order of
    their releases.
    """
    waiting: list[int] = []
    at, now_us, total_us = 0, from_us, 0
    while at < len(jobs) or waiting:
        if not waiting:
            now_us = max(now_us, jobs[at].release_us)
        while at < len(jobs) and jobs[at].release_us <= now_us:
            heappush(waiting, jobs[at].busy_us)
            at += 1
        rest_us = heappop(waiting)
        if at < len(jobs) and now_us + rest_us > jobs[at].release_us:
            heappush(waiting, rest_us - (jobs[at].release_us - now_us))
            now_us = jobs[at].release_us
        else:
            now_us += rest_us
            total_us += now_us
    return total_us


def _blocks(jobs: Sequence[BayJob], turn_us: int) -> list[list[BayJob]]:
    """Jobs in the order of their releases, cut where even with a turn before each all could be over before the next."""
    blocks: list[list[BayJob]] = []
    idle_us = 0
    for job in sorted(jobs):
        if not blocks or idle_us <= job.release_us - turn_us:
            blocks.append([])
            idle_us = job.release_us - turn_us
        blocks[-1].append(job)
        idle_us += turn_us + job.busy_us
    return blocks


class _Begun(NamedTuple):
    """The first jobs of an order, by their bits in ``done``, the last ending at ``end_us``; of equal bounds more first.

    ``least_us``: the sum of all ends is at least that. ``sum_us``: of those of the jobs done.
    """

    least_us: int
    left: int
    serial: int
    done: int
    goes_out: bool
    end_us: int
    sum_us: int


@dataclass
class _Order:
    jobs: list[BayJob]
    turn_us: int
    steps: int = 0

    def least_us(self, most_steps: int) -> int:
        """Best first: what is left to look at at any moment is at least the first of the queue."""
        serials = count()
        queue = [self._begun(next(serials), number, None) for number in self._next(None)]
        heapify(queue)
        seen: dict[tuple[int, bool], list[tuple[int, int]]] = {}
        while queue[0].left and self.steps <= most_steps:
            one = heappop(queue)
            others = seen.setdefault((one.done, one.goes_out), [])
            if any(end_us <= one.end_us and sum_us <= one.sum_us for end_us, sum_us in others):
                # Nothing is lost: the other one is in the queue, or what came of it is.
                continue
            others.append((one.end_us, one.sum_us))
            for number in self._next(one):
                heappush(queue, self._begun(next(serials), number, one))
        return queue[0].least_us

    def _rest(self, done: int) -> list[BayJob]:
        return [job for number, job in enumerate(self.jobs) if not done >> number & 1]

    def _starts_us(self, job: BayJob, before: _Begun | None) -> int:
        if before is None:
            return job.release_us
        turn_us = self.turn_us if before.goes_out is job.goes_out else 0
        return max(before.end_us + turn_us, job.release_us)

    def _next(self, before: _Begun | None) -> list[int]:
        """Jobs that may come next: none before which another would be over without delaying it."""
        done = 0 if before is None else before.done
        starts_us = {
            number: self._starts_us(job, before) for number, job in enumerate(self.jobs) if not done >> number & 1
        }
        self.steps += len(starts_us)
        over_us = {number: start_us + self.jobs[number].busy_us for number, start_us in starts_us.items()}
        return [
            number
            for number, start_us in starts_us.items()
            if not any(
                end_us + (self.turn_us if self.jobs[other].goes_out is self.jobs[number].goes_out else 0) <= start_us
                for other, end_us in over_us.items()
                if other != number
            )
        ]

    def _begun(self, serial: int, number: int, before: _Begun | None) -> _Begun:
        job = self.jobs[number]
        end_us = self._starts_us(job, before) + job.busy_us
        done = 1 << number | (0 if before is None else before.done)
        sum_us = end_us + (0 if before is None else before.sum_us)
        rest = self._rest(done)
        self.steps += len(rest)
        least_us = max(
            sum_us + self._rest_us(rest, end_us, goes_out=job.goes_out), 0 if before is None else before.least_us
        )
        return _Begun(least_us, len(rest), serial, done, job.goes_out, end_us, sum_us)

    def _rest_us(self, rest: list[BayJob], end_us: int, *, goes_out: bool) -> int:
        """A bound for what is left. Where all go one way each has a turn before it, if not the first of them."""
        if not rest or any(job.goes_out is not rest[0].goes_out for job in rest):
            return preemptive_ends_us(rest, end_us)
        turn_us = self.turn_us
        turned = [job._replace(release_us=job.release_us - turn_us, busy_us=job.busy_us + turn_us) for job in rest]
        return preemptive_ends_us(turned, end_us if goes_out is rest[0].goes_out else end_us - turn_us)
