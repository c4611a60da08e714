"""``onboard.pyz``: the program and its pinned wheels in one file that any Python of version 3.11 or newer runs.

Beside each source lies its bytecode for the Python that built the archive: one of that version starts without compiling
anything, any other takes the sources. The same sources and Python give the same bytes. The wheels' compiled parts are
left out, for they cannot be loaded from an archive and tie it to one processor; both libraries that have some carry the
same in Python.
"""

import importlib.util
import marshal
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

from deploy.wheels import pinned_wheels

ROOT = Path(__file__).parents[1]
PACKAGES = ("dbc", "onboard")
#: What a person needs at a new machine; the rest of ``hil`` is for the bench.
COMMISSIONING = ("hil/__init__.py", "hil/__main__.py", "hil/cli.py", "hil/notice.py", "hil/commission")
#: The first moment that a ZIP archive can name.
_TIME = (1980, 1, 1, 0, 0, 0)
_MAIN = b"import sys\n\nfrom onboard.__main__ import main\n\nsys.exit(main())\n"
#: Head of bytecode that is found by the hash of its source and never compared with it (PEP 552).
_UNCHECKED = importlib.util.MAGIC_NUMBER + (1).to_bytes(4, "little")
#: Docstrings of ours become a dot: nobody reads them on a board, and they take 0.4 MB of its memory. Without any, the
#: standard library's dataclasses would write one for each class, at a tenth of the time of the whole start.
_COMPILE = """\
import ast, marshal, sys
sources, ours = marshal.load(sys.stdin.buffer)
made = []
for name, text in sources:
    tree = ast.parse(text, name)
    for node in ast.walk(tree) if name.startswith(ours) else ():
        documented = isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef))
        if documented and ast.get_docstring(node, clean=False) is not None:
            node.body[0].value.value = "."
    made.append(marshal.dumps(compile(tree, name, "exec", dont_inherit=True, optimize=0)))
sys.stdout.buffer.write(marshal.dumps(made))
"""
_SHEBANG = b"#!/usr/bin/env python3\n"


def build_archive(to: Path) -> Path:
    """Write the archive. Raises ``DeployError`` where a wheel cannot be had, ``OSError``."""
    to.parent.mkdir(parents=True, exist_ok=True)
    with to.open("wb") as file:
        file.write(_SHEBANG)
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in sorted(_with_bytecode(sorted(_contents()))):
                entry = zipfile.ZipInfo(name, _TIME)
                entry.external_attr = 0o644 << 16
                archive.writestr(entry, content, zipfile.ZIP_DEFLATED, 9)
    # A device, such as /dev/null, keeps the rights that everybody else needs.
    if to.is_file():
        to.chmod(0o755)
    return to


def _with_bytecode(contents: list[tuple[str, bytes]]) -> Iterator[tuple[str, bytes]]:
    """The same files, and beside each module ``<name>.pyc``: the form that ``zipimport`` looks for first."""
    yield from contents
    sources = [(name, content) for name, content in contents if name.endswith(".py")]
    for (name, content), code in zip(sources, _compiled(sources), strict=True):
        yield f"{name}c", _UNCHECKED + importlib.util.source_hash(content) + code


def _compiled(sources: list[tuple[str, bytes]]) -> list[bytes]:
    """Bytecode of each module, by a process that does nothing else.

    What is marshalled names an object twice where somebody else holds it too: in this process that would be chance.
    """
    # Lines are enough to find a mistake by: columns are a fifth of the archive.
    command = [sys.executable, "-S", "-X", "no_debug_ranges", "-c", _COMPILE]
    asked = marshal.dumps((sources, tuple(f"{name}/" for name in PACKAGES)))
    done = subprocess.run(command, input=asked, capture_output=True, check=True, env={"PYTHONHASHSEED": "0"})
    found: list[bytes] = marshal.loads(done.stdout)
    return found


def _contents() -> Iterator[tuple[str, bytes]]:
    yield "__main__.py", _MAIN
    for place in (*PACKAGES, *COMMISSIONING):
        path = ROOT / place
        for file in path.rglob("*") if path.is_dir() else [path]:
            if file.is_file() and "__pycache__" not in file.parts:
                yield file.relative_to(ROOT).as_posix(), file.read_bytes()
    for name in ("LICENSE", "NOTICE", "THIRD_PARTY.md"):
        yield name, (ROOT / name).read_bytes()
    for wheel in pinned_wheels():
        with zipfile.ZipFile(wheel) as archive:
            for name in archive.namelist():
                if not name.endswith((".so", "/", ".pyi", "/RECORD")):
                    yield name, archive.read(name)
