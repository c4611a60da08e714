"""Every frame of fixed runs, fleet and device buses: who only moves code about changes none of them.

A change that means to change what is said writes the table anew: `python -m tests.system.test_same_traces`, and says so
in docs/decisions.md. The examples of docs/protocol.md are of one of these runs, and are taken anew with it.
"""

import hashlib
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from bus_sim.cli import main
from tests.protocol import page
from tests.protocol.examples import EXAMPLES, RUN, lines_of

#: Options of `bus-sim run`, and the first 64 bits of SHA-256 over the log that it writes.
RUNS = {
    "level1 --random 40 15 --cars 3": "905009e853de4771",
    "small --random 40 15 --cars 3 --fault crash:target=MR1,at_s=80,restart_s=5": "26c83233e0806613",
    "standard --random 30 15 --cars 3": "e0746ae6829a14d5",
    "large --random 30 15 --cars 2": "9c5069046670a2a9",
    "graph --for 150": "c9c60c76829b0e35",
    "terminal --for 150": "add1c5eb42421429",
}


def played(options: str, log: Path) -> str:
    """What the log of a run comes to."""
    main(["run", *options.split(), "--seed", "1", "--speed", "max", "--no-web", "--devices", "--trace", str(log)])
    return hashlib.sha256(log.read_bytes()).hexdigest()[:16]


@pytest.mark.parametrize("options", RUNS)
def test_a_run_says_what_it_always_said(options: str, tmp_path: Path) -> None:
    log = tmp_path / "run.log"
    assert played(options, log) == RUNS[options]
    if options == RUN:
        shown, said = page.parts(page.PAGE.read_text(encoding="utf-8")), log.read_text(encoding="utf-8").splitlines()
        examples = [line for name in EXAMPLES for line in lines_of(shown["example", name])]
        assert not set(examples) - set(said), "docs/protocol.md: take its examples anew (at the top of this file)"


def renew(source: Path) -> None:
    """Write what the runs say today into this file."""
    text = source.read_text(encoding="utf-8")
    with TemporaryDirectory() as folder:
        for options, known in RUNS.items():
            log = Path(folder) / "run.log"
            text = text.replace(f'"{options}": "{known}"', f'"{options}": "{played(options, log)}"')
            if options == RUN:
                page.write(log)
    source.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    renew(Path(__file__))
