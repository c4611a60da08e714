"""How far a reader has to walk: which files one frame visits, and through which the time of an event is handed on.

Both are taken from a scene as it is played, so that nothing has to be guessed about who calls whom.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from types import CodeType, FrameType

from bus_sim.faults.injection import parse_injection
from bus_sim.options import RunOptions
from bus_sim.session import play
from bus_sim.sites import find_site
from bus_sim.systems.car_park.day import ParkingDay
from onboard.contract.messages import Bid

ROOT = Path(__file__).parents[2]
_PRODUCT = str(ROOT / "onboard")
#: File and qualified name of a function.
Function = tuple[str, str]


@dataclass
class Walks:
    """What a scene was seen to do: ``bids`` has the files that each visited, ``calls`` who calls whom with the time.

    A file is visited where any function of it runs, from the frame's arrival at the shell until the shell is done with
    it: generated files, the codec and what is due after the frame count like everything else. Calls are those below
    ``start`` between functions that take ``now_us``, in the order in which they were seen first.
    """

    start: str
    bids: list[frozenset[str]] = field(default_factory=list)
    calls: dict[Function, dict[Function, None]] = field(default_factory=dict)
    _files: set[str] = field(default_factory=set)
    _is_bid: bool = False
    _shell: FrameType | None = None
    _stack: list[tuple[FrameType, Function]] = field(default_factory=list)

    def trace(self, frame: FrameType, event: str, _: object) -> None:
        """For ``sys.setprofile``."""
        code = frame.f_code
        if event == "return":
            self._leaves(frame)
        elif event == "call" and code.co_filename.startswith(_PRODUCT):
            self._enters(frame, code)

    def _enters(self, frame: FrameType, code: CodeType) -> None:
        if code.co_qualname == "Controller._on_fleet_frame":
            self._shell, self._is_bid = frame, False
            self._files.clear()
        if self._shell is not None:
            self._files.add(code.co_filename)
            self._is_bid |= code.co_qualname == "Holon.receive" and isinstance(frame.f_locals["message"], Bid)
        if "now_us" not in code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]:
            return
        function = (code.co_filename, code.co_qualname)
        if self._stack:
            self.calls.setdefault(self._stack[-1][1], {}).setdefault(function)
        if self._stack or code.co_qualname == self.start:
            self._stack.append((frame, function))

    def _leaves(self, frame: FrameType) -> None:
        if self._stack and self._stack[-1][0] is frame:
            self._stack.pop()
        if frame is self._shell:
            self._shell = None
            if self._is_bid:
                self.bids.append(frozenset(self._files))

    def stays(self) -> list[str]:
        """Files in the order of a walk from ``start``: each function once, where it is first met, and back again."""
        start = next(one for one in self.calls if one[1] == self.start)
        files = list(self._walk(start, {start}))
        return files[:1] + [after for before, after in pairwise(files) if after != before]

    def _walk(self, function: Function, seen: set[Function]) -> Iterator[str]:
        yield function[0]
        for callee in self.calls.get(function, ()):
            if callee not in seen:
                seen.add(callee)
                yield from self._walk(callee, seen)
                yield function[0]


def walks(start: str) -> Walks:
    """Of three cars in a small car park, one robot of which is started again: a scene whose trace is kept."""
    seen = Walks(start)
    crash = parse_injection("crash:target=MR1,at_s=80,restart_s=5")
    options = RunOptions(demand=ParkingDay(random_s=(40.0, 15.0), cars=3), faults=(crash,), quiet=True)
    sys.setprofile(seen.trace)
    try:
        play(find_site("small"), options)
    finally:
        sys.setprofile(None)
    return seen
