"""A log of machines that speak another contract: whoever reads it is told, as layouts may be others there."""

import re
from pathlib import Path

import pytest

from onboard.contract.codes import CONTRACT_VERSION
from onboard.trace.cli import main
from tests.trace.runs import SITE_FILE, run_log

#: A contract that no build of this version speaks: while it is open, the highest bit is set.
OTHER = 2
#: What stands before the data of robot 11's signs of life.
BEATS = re.compile(r"(1250000B#)[0-9A-F]{2}")


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """MR1 alone speaks another contract."""
    path = tmp_path / "other.log"
    path.write_text(BEATS.sub(rf"\g<1>{OTHER:02X}", run_log().read_text(encoding="utf-8")), encoding="utf-8")
    return path


@pytest.mark.parametrize("words", [["check"], ["calls"], ["why"], ["dump", "--decode"]], ids=" ".join)
def test_who_speaks_another_contract_is_named(words: list[str], log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for file, is_told in ((log, True), (run_log(), False)):
        main([words[0], str(file), *words[1:], "--site", str(SITE_FILE)])
        told = "".join(capsys.readouterr())
        assert ("read the log with the version that wrote it" in told) is is_told
        assert (f"({CONTRACT_VERSION} is its own): " in told) is is_told
        assert bool(re.search(rf"(node 11|MR1) {OTHER}; read the log", told)) is is_told


def test_it_stands_beside_the_word_itself(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["dump", str(log), "--decode", "--site", str(SITE_FILE)])
    beats = [line for line in capsys.readouterr().out.splitlines() if " Heartbeat: " in line]
    told = {line.split(" Heartbeat: ")[0].split()[-1]: line.split("contract ")[1].split(",")[0] for line in beats}
    ours = str(CONTRACT_VERSION)
    assert told.pop("MR1") == f"{OTHER} (this program reads {ours})" and set(told.values()) == {ours}
