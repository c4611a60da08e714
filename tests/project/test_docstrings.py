"""Docstrings say something: not four words, not only where else to look."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PRODUCTS = ("bench", "bus_sim", "deploy", "hil", "onboard")

#: Four words name a thing, as its name does already; the fifth may say what is particular.
FEWEST_WORDS = 5
#: A reference to another place in so many words adds nothing of its own.
BACK_REFERENCE_WORDS = 10
_BACK_REFERENCE = re.compile(r"(?:As in the port|See (?:above|``[\w.]+``))\s*[.;,]")


def says_little(docstring: str) -> bool:
    """Whether a docstring is too short to say more than the name, or only refers elsewhere."""
    words = len(docstring.split())
    if words < FEWEST_WORDS:
        return True
    return words <= BACK_REFERENCE_WORDS and _BACK_REFERENCE.match(docstring) is not None


def public_docstrings(text: str) -> Iterator[tuple[int, str, str]]:
    """Line, name and docstring of every public class, function and method of a source."""

    def walk(body: list[ast.stmt], outer: str) -> Iterator[tuple[int, str, str]]:
        for node in body:
            if not isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) or node.name[0] == "_":
                continue
            name, docstring = f"{outer}{node.name}", ast.get_docstring(node)
            if docstring is not None:
                yield node.lineno, name, docstring
            if isinstance(node, ast.ClassDef):
                yield from walk(node.body, f"{name}.")

    yield from walk(ast.parse(text).body, "")


def found() -> dict[str, list[str]]:
    """What says little, by folder: the second one below ``onboard`` and ``bus_sim``, else the first."""
    places: dict[str, list[str]] = {}
    for product in PRODUCTS:
        for file in sorted((ROOT / product).rglob("*.py")):
            path = file.relative_to(ROOT)
            depth = 2 if product in ("bus_sim", "onboard") and len(path.parts) > 2 else 1
            folder = "/".join(path.parts[:depth])
            for line, name, docstring in public_docstrings(file.read_text(encoding="utf-8")):
                if says_little(docstring):
                    places.setdefault(folder, []).append(f"{path}:{line}: {name}: {docstring}")
    return places


def test_no_docstring_says_little() -> None:
    text = "\n".join(line for lines in found().values() for line in lines)
    assert not text, f"say what is particular here (unit, range, errors, what happens), in a plain sentence:\n{text}"


@pytest.mark.parametrize(
    "docstring", ["The task is gone.", "As in the port.", "See ``Device``; a write is lost.", "See above."]
)
def test_a_docstring_that_says_little_is_found(docstring: str) -> None:
    source = f'class Public:\n    def method(self) -> None:\n        """{docstring}"""\n'
    assert [says_little(one) for *_, one in public_docstrings(source)] == [True]


@pytest.mark.parametrize(
    "docstring",
    [
        "Put its plug on the fleet bus back in.",
        "As in the port. Frames that came before the first subscriber are counted as received and gone.",
    ],
)
def test_a_sentence_is_enough(docstring: str) -> None:
    assert not says_little(docstring)


def test_what_is_private_needs_none() -> None:
    assert not list(public_docstrings('class _A:\n    """A."""\n    def b(self) -> None:\n        """B."""\n'))
