"""What stands in the documents stands once: the table of layers names each; changes are told by version and sort."""

import re
from pathlib import Path

from onboard import __version__

ROOT = Path(__file__).parents[2]
TABLE = re.compile(r"^\| layer \|.*\| may import \|$", re.MULTILINE)


def test_the_table_of_layers_stands_once() -> None:
    documents = [*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]
    places = [file.relative_to(ROOT).as_posix() for file in documents if TABLE.search(file.read_text(encoding="utf-8"))]
    assert places == ["docs/design.md"], (
        "the table of layers stands in docs/design.md, section 2; elsewhere refer to it"
    )


def test_the_table_of_layers_names_every_folder() -> None:
    text = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")
    begin = TABLE.search(text)
    assert begin is not None
    table = text[begin.start() :].split("\n\n", 1)[0]
    below = [file.parent for file in (ROOT / "onboard").glob("*/__init__.py")]
    folders = [*below, *(ROOT / name for name in ("bus_sim", "dbc", "deploy", "hil"))]
    names = [folder.relative_to(ROOT).as_posix() for folder in folders]
    missing = [name for name in names if f"| `{name}` |" not in table]
    assert not missing, f"docs/design.md, section 2: say of these what they are, and what they may import: {missing}"


def test_changes_are_told_by_version_and_sort() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    versions = re.findall(r"^## \[(.+?)\](?: - (\d{4}-\d{2}-\d{2}))?$", text, re.MULTILINE)
    released = [version for version, day in versions if day]
    assert [version for version, day in versions if not day] in ([], ["Unreleased"])
    assert released[0] == __version__, "the newest version of CHANGELOG.md is not that of the package"
    sorts = set(re.findall(r"^### (.+)$", text, re.MULTILINE))
    assert sorts <= {"Added", "Changed", "Fixed"}, f"CHANGELOG.md sorts by Added, Changed and Fixed, not by {sorts}"
    marked = re.findall(r"^- (?:Fixed|Changed|Added):.*$", text, re.MULTILINE)
    assert not marked, f"CHANGELOG.md: these belong below the heading that they name: {marked}"


def test_a_merge_leaves_no_mark_and_no_line_twice_in_a_row_of_a_decision() -> None:
    """Both sides of a merge in one document read on as if nothing were wrong."""
    for path in (*(ROOT / "docs").rglob("*.md"), ROOT / "CHANGELOG.md", ROOT / "README.md"):
        lines = path.read_text(encoding="utf-8").splitlines()
        assert not [line for line in lines if line.startswith(("<<<<<<< ", ">>>>>>> "))], path
    for paragraph in (ROOT / "docs" / "decisions.md").read_text(encoding="utf-8").split("\n\n"):
        begins = [line[:60] for line in paragraph.splitlines() if len(line) > 60 and not line.startswith("|")]
        assert len(begins) == len(set(begins)), paragraph[:80]
