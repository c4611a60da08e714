"""The table of reason codes in the page for those who set boards up: whole, and as the program has it."""

from pathlib import Path

from deploy.reasons import ADVICE, table
from onboard.contract.codes import Reason

README = Path(__file__).parents[2] / "deploy" / "README.md"


def test_every_reason_code_has_its_advice_and_no_other() -> None:
    assert set(ADVICE) == set(Reason)
    assert all(advice.meaning and advice.remedy for advice in ADVICE.values())


def test_the_page_has_the_table_as_the_program_has_it() -> None:
    lines = README.read_text(encoding="utf-8").splitlines()
    begin = lines.index(table()[0])
    found = lines[begin : begin + len(table())]
    assert found == table(), "deploy/README.md: put in what `python -m deploy.reasons` prints"
    assert not any(line.startswith("|") for line in lines[begin + len(table()) :][:1])


def test_codes_that_nobody_says_are_told_as_such() -> None:
    onboard = README.parents[1] / "onboard"
    # What only reads a bus says nothing there.
    readers = ("trace", "web", "gateway")
    files = [file for file in onboard.rglob("*.py") if file.relative_to(onboard).parts[0] not in readers]
    text = "\n".join(file.read_text(encoding="utf-8") for file in files)
    unsaid = {code for code in Reason if f"Reason.{code.name}" not in text}
    kept = {code for code, advice in ADVICE.items() if advice.meaning.startswith("kept in the contract")}
    # While contract 2 is open its words come before those who say them.
    assert kept == {code for code in unsaid if code < Reason.NOT_OF_SITE}
