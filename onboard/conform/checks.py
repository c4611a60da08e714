"""One check is one sentence of docs/protocol.md, judged in one scene or all the time."""

from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

from onboard.core.frame import Frame

#: Most frames that are shown for a check: what it rests on, not the whole log.
MOST_FRAMES = 12


class Verdict(Enum):
    """What came of a check."""

    PASSED = "passed"
    FAILED = "failed"
    NOT_REACHED = "not reached"


@dataclass(frozen=True, slots=True)
class Check:
    """``duty`` is its number in docs/protocol.md, such as "K5"; ``sentence`` stands there word for word."""

    name: str
    duty: str
    sentence: str


class Shown(NamedTuple):
    """A frame that a verdict rests on; ``time_us`` is since the play began."""

    time_us: int
    frame: Frame


@dataclass(slots=True)
class CheckResult:
    """What is known of one check so far: the first failure stands, whatever is seen later."""

    check: Check
    scene: str
    verdict: Verdict = Verdict.NOT_REACHED
    why: str = ""
    frames: tuple[Shown, ...] = ()

    def judge(self, why: str, frames: tuple[Shown, ...], *, is_kept: bool) -> None:
        """The duty was seen kept or broken; ``why`` says what was seen where it was broken."""
        if self.verdict is Verdict.FAILED:
            return
        self.verdict = Verdict.PASSED if is_kept else Verdict.FAILED
        self.why = "" if is_kept else why
        self.frames = frames[:MOST_FRAMES]


@dataclass
class Findings:
    """All checks of a play by name, in the order of the scenes."""

    by_name: dict[str, CheckResult] = field(default_factory=dict)

    def add(self, scene: str, checks: tuple[Check, ...]) -> None:
        """The checks of one scene. Raises ``ValueError`` for a name that is there already."""
        for check in checks:
            if check.name in self.by_name:
                raise ValueError(f"two checks are named {check.name}")
            self.by_name[check.name] = CheckResult(check, scene)

    def of(self, verdict: Verdict) -> list[CheckResult]:
        """Those with this verdict, in the order of the scenes."""
        return [one for one in self.by_name.values() if one.verdict is verdict]
