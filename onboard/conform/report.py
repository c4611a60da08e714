"""What came of a play: JUnit for machines, Markdown to be signed for people, a line each for the terminal."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape, quoteattr

from onboard.conform.checks import CheckResult, Findings, Shown, Verdict

#: Status of the program: all that was reached is kept; something is broken, or nothing was reached.
CONFORMS, BREAKS = 0, 1
#: What XML cannot hold even as a number: control characters but tab and line ends.
_UNPRINTABLE = {code: "?" for code in range(32) if code not in (9, 10, 13)}


@dataclass(frozen=True, slots=True)
class NodeUnderTest:
    """What was judged, where and by which versions; ``date`` in ISO 8601, all for people.

    ``unlike`` names the constants of the site for which the play was not written.
    """

    node: int
    name: str
    kind: str
    site: str
    digest: int
    contract: int
    program: str
    bus: str
    date: str
    unlike: tuple[str, ...] = ()


def status(findings: Findings) -> int:
    """Whether the node conforms, as far as it was reached."""
    return CONFORMS if not findings.of(Verdict.FAILED) and findings.of(Verdict.PASSED) else BREAKS


def totals(findings: Findings) -> str:
    """One line: how many checks, and how many of each verdict."""
    counts = ", ".join(f"{len(findings.of(one))} {one.value}" for one in Verdict)
    return f"{len(findings.by_name)} checks: {counts}"


def doubts(unlike: Sequence[str]) -> str:
    """What is told of constants for which the play was not written."""
    return f"{', '.join(unlike)}: what fails may be the play's; bench with a site file without them to be sure"


def lines_of(finding: CheckResult, words: Callable[[Shown], str]) -> list[str]:
    """A check that was broken, with its sentence and the frames that show it."""
    check = finding.check
    head = f"{finding.verdict.value.upper()}  {check.name}: {finding.why}"
    return [head, f"    [{check.duty}] {check.sentence}", *(f"    {words(one)}" for one in finding.frames)]


def frame_words(shown: Shown) -> str:
    """A frame as candump writes it, with seconds since the play began."""
    frame = shown.frame
    number = f"{frame.arbitration_id:08X}" if frame.is_extended else f"{frame.arbitration_id:03X}"
    data = f"R{frame.remote_dlc}" if frame.is_remote else frame.data.hex().upper()
    return f"({shown.time_us / 1e6:.6f}) {number}#{data}"


def junit(findings: Findings, subject: NodeUnderTest, words: Callable[[Shown], str]) -> str:
    """A test suite with a case for each check; those that were not reached are skipped."""
    failed, skipped = len(findings.of(Verdict.FAILED)), len(findings.of(Verdict.NOT_REACHED))
    suite = f"onboard conform {subject.name} (node {subject.node})"
    head = (
        f"<testsuite name={_attribute(suite)} tests={_attribute(str(len(findings.by_name)))} "
        f"failures={_attribute(str(failed))} skipped={_attribute(str(skipped))} "
        f"timestamp={_attribute(subject.date)}>"
    )
    cases = [line for finding in findings.by_name.values() for line in _case(finding, words)]
    return "\n".join(['<?xml version="1.0" encoding="UTF-8"?>', head, *cases, "</testsuite>", ""])


def _case(finding: CheckResult, words: Callable[[Shown], str]) -> list[str]:
    check = finding.check
    start = f"  <testcase classname={_attribute(finding.scene)} name={_attribute(f'{check.name} [{check.duty}]')}"
    if finding.verdict is Verdict.PASSED:
        return [f"{start}/>"]
    if finding.verdict is Verdict.NOT_REACHED:
        return [f"{start}>", f"    <skipped message={_attribute(finding.why or 'not reached')}/>", "  </testcase>"]
    told = escape("\n".join(lines_of(finding, words)[1:]).translate(_UNPRINTABLE))
    return [f"{start}>", f"    <failure message={_attribute(finding.why)}>{told}</failure>", "  </testcase>"]


def _attribute(text: str) -> str:
    return quoteattr(text.translate(_UNPRINTABLE))


def protocol(findings: Findings, subject: NodeUnderTest, words: Callable[[Shown], str]) -> str:
    """Markdown to be printed and signed: what was judged, each check and its result, those that failed in full."""
    rows = [
        f"| {name} | {value} |"
        for name, value in (
            ("date", subject.date),
            ("node", f"{subject.node} ({subject.name}, {subject.kind})"),
            ("site", f"{subject.site}, digest {subject.digest:04X}"),
            ("contract", f"{subject.contract}"),
            ("program", subject.program),
            ("bus", subject.bus),
            *((("not played for", doubts(subject.unlike)),) if subject.unlike else ()),
            ("result", totals(findings)),
        )
    ]
    text = ["# Conformity of a node", "", "| | |", "|---|---|", *rows, "", "| scene | check | duty | result |"]
    text += ["|---|---|---|---|"]
    for one in findings.by_name.values():
        why = f": {one.why}" if one.verdict is Verdict.NOT_REACHED and one.why else ""
        text.append(f"| {one.scene} | {one.check.name} | {one.check.duty} | {one.verdict.value}{why} |")
    failed = findings.of(Verdict.FAILED)
    if failed:
        text += ["", "## What is broken", ""]
        for one in failed:
            text += ["```text", *lines_of(one, words), "```", ""]
    who = ("Played by", "Date and signature", "Accepted by", "Date and signature")
    return "\n".join([*text, "", *(f"{name}: {'_' * 40}\n" for name in who)])
