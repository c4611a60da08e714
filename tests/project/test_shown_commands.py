"""Each command that a page shows in a block is one that its program takes, and whose files are there."""

import argparse
import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import bus_sim.cli
import onboard.conform.cli
import onboard.gateway.cli
import onboard.keys.cli
import onboard.operate.cli
import onboard.trace.cli
import onboard.web.cli
from tests.project.rows import ROOT

PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "SECURITY.md", *sorted((ROOT / "docs").rglob("*.md"))]
PARSERS: dict[str, Callable[[], argparse.ArgumentParser]] = {
    "bus-sim": bus_sim.cli.build_parser,
    "onboard conform": onboard.conform.cli.build_parser,
    "onboard gateway": onboard.gateway.cli.build_parser,
    "onboard keys": onboard.keys.cli.build_parser,
    "onboard operate": onboard.operate.cli.build_parser,
    "onboard trace": onboard.trace.cli.build_parser,
    "onboard web": onboard.web.cli.build_parser,
}
#: What stands before a command and is none of it.
_BEFORE = re.compile(r"[A-Z_]+=.*|sudo|exec|\$")


def shown(page: Path) -> Iterator[list[str]]:
    """The words of each command in the page's blocks for shells; behind a pipe, or ``&&``, one of its own."""
    for block in re.findall(r"^```(?:sh|console)\n(.*?)^```", page.read_text(encoding="utf-8"), re.S | re.M):
        for line in block.replace("\\\n", " ").splitlines():
            for part in re.split(r" (?:\||&&|&|>) ?", re.sub(r"(^|\s)#.*", "", line)):
                is_whole = part.count('"') % 2 == part.count("'") % 2 == 0
                words = shlex.split(part) if is_whole else part.split()
                while words and _BEFORE.fullmatch(words[0]):
                    words = words[1:]
                if words:
                    yield [Path(words[0]).name, *words[1:]]


def wrong(words: list[str]) -> str:
    """What is wrong with a command of ours; empty for a right one, and for those of others."""
    match words:
        case ["make", *targets]:
            makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
            unknown = [one for one in targets if "=" not in one and f"\n{one}:" not in makefile]
            return f"no target {unknown}" if unknown else ""
        case ["python" | "python3", "-m", module, *_] if module.split(".")[0] in ("bench", "tests", "hil", "deploy"):
            place = ROOT / module.replace(".", "/")
            return "" if place.with_suffix(".py").is_file() or (place / "__main__.py").is_file() else f"no {module}"
        case ["python" | "python3" | "pytest", *rest]:
            named = [one.split("::")[0] for one in rest if re.match(r"(bench|tests|hil|deploy)/", one)]
            return "".join(f"no {one}" for one in named if not (ROOT / one).exists())
    for program, parser in PARSERS.items():
        name = program.split()
        if words[: len(name)] == name:
            try:
                parser().parse_args(words[len(name) :])
            except SystemExit as end:
                return "its parser ends" if end.code else ""
    return ""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_shown_command_is_taken(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = [f"{' '.join(words)}: {told} {capsys.readouterr().err}" for words in shown(page) if (told := wrong(words))]
    assert not found, "\n".join(found)


def test_there_are_commands_and_a_wrong_one_is_found() -> None:
    assert len([words for page in PAGES for words in shown(page) if words[0] in ("bus-sim", "onboard")]) > 40
    assert wrong(["bus-sim", "run", "small", "--no-such-option"])
    assert wrong(["python", "-m", "bench.nothing"]) and wrong(["make", "nothing"]) and wrong(["pytest", "tests/no.py"])
