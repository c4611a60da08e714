"""The core is the protocol and nothing else: its size, and no word of what machines move or are, nor in a holon."""

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.project.layers import imports_of

ROOT = Path(__file__).parents[2]
CORE, HOLON = ROOT / "onboard" / "core", ROOT / "onboard" / "holon"
#: What the wire says: its words are the contract's, wherever they stand.
CONTRACT = ("codes.py", "messages.py", "recovery_messages.py")
#: Words of single systems. A number of the wire may be called by its field's name where it is read from a message.
FORBIDDEN = frozenset(
    f"{word}{ending}"
    for word in ("car", "compartment", "door", "lift", "platform", "shuttle", "spur", "wheelbase")
    for ending in ("", "s")
)
#: At most so many lines, all counted, of the protocol; and of what puts one machine together of it.
MOST_LINES = {CORE: 4_200, HOLON: 2_950}


def files(folder: Path) -> list[Path]:
    return [file for file in sorted(folder.rglob("*.py")) if file.name not in CONTRACT]


def words_of(text: str) -> Iterator[tuple[int, str]]:
    """Line and word, in lower case, of all names, comments and strings: ``CarAt`` is car and at."""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type in (tokenize.NAME, tokenize.COMMENT, tokenize.STRING):
            split = re.sub(r"([a-z0-9])([A-Z])", r"\1 \2", token.string)
            yield from ((token.start[0], word.lower()) for word in re.findall(r"[A-Za-z]+", split))


def test_words_are_found_wherever_they_stand() -> None:
    text = '"""Doors."""\nfrom x import CarAt  # a lift\nwheelbase_mm = f("spur_of", Kind.SHUTTLE)\n'
    assert [word for _, word in words_of(text) if word in FORBIDDEN] == [
        *("doors", "car", "lift", "wheelbase", "spur", "shuttle")
    ]


def test_the_core_has_no_word_of_what_its_machines_are() -> None:
    found = [
        f"{file.relative_to(ROOT)}:{line}: {word}"
        for file in (*files(CORE), *files(HOLON))
        for line, word in words_of(file.read_text(encoding="utf-8"))
        if word in FORBIDDEN
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize("folder", MOST_LINES, ids=lambda folder: folder.name)
def test_it_stays_small(folder: Path) -> None:
    assert sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files(folder)) <= MOST_LINES[folder]


PACKAGES = ("onboard.contract", "onboard.core", "onboard.holon", "onboard.ways", "onboard.work", "onboard.systems")


def package_of(module: str) -> str | None:
    """The package of a module; each system is one of its own, and the registry that finds them another."""
    parts = module.split(".")
    top = ".".join(parts[:2])
    if top not in PACKAGES:
        return None
    is_system = top == "onboard.systems" and len(parts) > 2 and (ROOT / "onboard" / "systems" / parts[2]).is_dir()
    return ".".join(parts[:3]) if is_system else top


def imports_by_package() -> dict[str, set[str]]:
    found: dict[str, set[str]] = {}
    for package in PACKAGES:
        for file in sorted(ROOT.joinpath(*package.split(".")).rglob("*.py")):
            parts = file.relative_to(ROOT).with_suffix("").parts
            module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            tree = ast.parse(file.read_text(encoding="utf-8"))
            own = package_of(module)
            assert own is not None
            for one in imports_of(tree, ROOT, module, is_package=file.name == "__init__.py"):
                other = package_of(one.module)
                if other not in (None, own):
                    found.setdefault(own, set()).add(str(other))
    return found


def test_no_package_imports_one_that_imports_it() -> None:
    imports = imports_by_package()
    reached = {package: set(direct) for package, direct in imports.items()}
    for _ in imports:
        for others in reached.values():
            others |= {far for near in others for far in reached.get(near, ())}
    assert not [package for package, others in reached.items() if package in others]


@pytest.mark.parametrize("system", ["cell", "turning"])
def test_a_system_without_ways_loads_none(system: str) -> None:
    reached, unread = set[str](), [f"onboard.systems.{system}.system"]
    while unread:
        module = unread.pop()
        path = ROOT.joinpath(*module.split("."))
        file = path.with_suffix(".py") if path.with_suffix(".py").is_file() else path / "__init__.py"
        if module in reached or not module.startswith("onboard.") or not file.is_file():
            continue
        reached.add(module)
        tree = ast.parse(file.read_text(encoding="utf-8"))
        unread += [one.module for one in imports_of(tree, ROOT, module, is_package=file.name == "__init__.py")]
    assert not [module for module in reached if module.startswith("onboard.ways")]
