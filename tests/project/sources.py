"""Rules of the house that no linter knows, checked on the text of the sources. One line for each breach."""

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from pathlib import Path

#: Most lines of a source file; split by noun before it hurts.
MAX_LINES = 500

FOLDERS = (".ci", "bench", "bus_sim", "dbc", "deploy", "docs", "hil", "onboard", "tests")
TEXT_SUFFIXES = frozenset({".cfg", ".dbc", ".lua", ".md", ".py", ".service", ".sh", ".toml"})

# "noqa" and "type: ignore" need the rule's name and then a reason: ``
_SUPPRESSION = re.compile(r"#\s*(?P<what>noqa|type:\s*ignore|pragma:\s*no cover)(?P<rest>.*)")
_NAMED_WITH_REASON = re.compile(r"\s*(?::\s*[A-Z]+\d+(?:\s*,\s*[A-Z]+\d+)*|\[[a-z\-, ]+\]|)(?P<reason>.*)")
_NAMED = re.compile(r"\s*(?::\s*[A-Z]+\d+|\[[a-z\-]+)")
_LEFT_TO_DO = re.compile(r"\b(?:TO[D]O|FIX[M]E|X[X]X|HA[C]K)\b")
_MACHINE_PATH = re.compile(
    r"(?<![\w.:/-])/(?:work|root|opt/wheels|home/\w+|tmp/(?:brief|venv|issue\w*))(?:/|\b)|\.\./shared\b"
)
_DOCUMENT = re.compile(r"(?<![\w/.-])docs/[\w-]+\.md\b")


def text_files(root: Path) -> list[Path]:
    """Every text file of the project below ``root`` that a person wrote, sorted."""
    inside = [file for name in FOLDERS for file in (root / name).rglob("*") if file.suffix in TEXT_SUFFIXES]
    top = [file for file in root.iterdir() if file.suffix in TEXT_SUFFIXES or file.name == "Makefile"]
    scripts = [root / ".ci" / "run"]
    return sorted(file for file in (*inside, *top, *scripts) if file.is_file())


def check_tree(root: Path) -> list[str]:
    """All breaches of all rules in the text files below ``root``."""
    breaches: list[str] = []
    for file in text_files(root):
        place = file.relative_to(root).as_posix()
        text = file.read_text(encoding="utf-8")
        breaches += check_text(place, text)
        for number, name in _documents(text):
            if not (root / name).is_file():
                breaches.append(f"{place}:{number}: {name} does not exist")
    return breaches


def check_text(place: str, text: str) -> list[str]:
    """All breaches in one file's text; ``place`` is its path in the project and tells what it is."""
    breaches = [f"{place}:{number}: path of one machine: {what}" for number, what in _matches(_MACHINE_PATH, text)]
    if not place.endswith(".py"):
        return breaches + [f"{place}:{number}: left to do: {what}" for number, what in _matches(_LEFT_TO_DO, text)]
    lines = text.count("\n")
    if lines > MAX_LINES:
        breaches.append(f"{place}:{MAX_LINES}: {lines} lines; split it by noun")
    nodes = list(ast.walk(ast.parse(text, place)))
    # To cut a text into its tokens takes longer than all else, and few texts have anything that comments matter for.
    is_broad = any(isinstance(node, ast.ExceptHandler) and _is_broad(node) for node in nodes)
    is_told = is_broad or _SUPPRESSION.search(text) or _LEFT_TO_DO.search(text)
    comments = dict(_comments(text)) if is_told else {}
    breaches += [f"{place}:{number}: {what}" for number, what in _bad_comments(comments)]
    breaches += [f"{place}:{number}: {what}" for number, what in _bad_statements(nodes, comments)]
    return breaches


def _matches(pattern: re.Pattern[str], text: str) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(text.splitlines(), 1):
        found = pattern.search(line)
        if found:
            yield number, found.group()


def _documents(text: str) -> Iterator[tuple[int, str]]:
    for number, line in enumerate(text.splitlines(), 1):
        for name in _DOCUMENT.findall(line):
            yield number, name


def _comments(text: str) -> Iterator[tuple[int, str]]:
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            yield token.start[0], token.string


def _bad_comments(comments: dict[int, str]) -> Iterator[tuple[int, str]]:
    for number, comment in comments.items():
        if _LEFT_TO_DO.search(comment):
            yield number, f"left to do: {comment}"
        found = _SUPPRESSION.search(comment)
        if found is None:
            continue
        what, rest = found["what"], found["rest"]
        if not what.startswith("pragma") and not _NAMED.match(rest):
            yield number, f"{what} names no rule"
        reason = _NAMED_WITH_REASON.match(rest)
        if reason is None or len(reason["reason"].strip(" #:-")) < len("because"):
            yield number, f"{what} gives no reason beside it"


def _bad_statements(nodes: list[ast.AST], comments: dict[int, str]) -> Iterator[tuple[int, str]]:
    for node in nodes:
        if isinstance(node, ast.ImportFrom) and node.module == "time" and any(a.name == "sleep" for a in node.names):
            yield node.lineno, "sleeps in real time"
        if isinstance(node, ast.Attribute) and node.attr == "sleep" and ast.unparse(node.value) == "time":
            yield node.lineno, "sleeps in real time"
        if isinstance(node, ast.ExceptHandler) and _is_broad(node):
            where = {node.lineno, node.lineno + 1, node.lineno - 1}
            if not where & comments.keys():
                yield node.lineno, "catches everything and does not say why"


def _is_broad(handler: ast.ExceptHandler) -> bool:
    kinds = handler.type.elts if isinstance(handler.type, ast.Tuple) else [handler.type]
    return any(kind is None or ast.unparse(kind) in ("Exception", "BaseException") for kind in kinds)
