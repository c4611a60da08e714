"""What docs/security.md says to be shown is shown by a test that is there."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
TEST = re.compile(r"`((?:tests|deploy|hil)/\S+?\.py)::(test_\w+)`")


def threats() -> list[str]:
    text = (ROOT / "docs" / "security.md").read_text(encoding="utf-8")
    section = text.split("\n## Threats\n")[1].split("\n## ")[0]
    return [line for line in section.splitlines() if line.startswith("| ")][1:]


def test_every_threat_names_tests_that_are_there() -> None:
    rows = threats()
    assert len(rows) >= 15
    for row in rows:
        named = TEST.findall(row)
        assert named, f"names no test: {row[:80]}"
        assert row.count("::") == len(named), f"a test is named in another form: {row[:80]}"
        for file, name in named:
            text = (ROOT / file).read_text(encoding="utf-8")
            assert re.search(rf"^(?:async )?def {name}\(", text, re.MULTILINE), f"{file} has no {name}"


def test_a_weakness_can_be_reported_without_an_address_of_anybody() -> None:
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    assert "private vulnerability reporting" in text and "@" not in text
    assert "docs/security.md" in text and "SECURITY.md" in (ROOT / "README.md").read_text(encoding="utf-8")
