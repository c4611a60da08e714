"""Files that a command line asks for, looked at before anything runs: hours do not end at a mistyped name."""

import argparse
import os
from collections.abc import Iterator
from pathlib import Path

#: Options of all commands that name a file to be written, and those that name a folder.
FILES = ("trace", "json", "counterexample", "output", "add_to", "out_file", "draw")
FOLDERS = ("out", "process_dir")


class OutputError(ValueError):
    """A file that cannot be written: the option, the value and the remedy in one line."""


def check_outputs(args: argparse.Namespace) -> None:
    """Raise ``OutputError`` for a file whose folder is not there or may not be written to, or that is a folder."""
    for option, path in _named(args, FILES):
        if path.is_dir():
            raise OutputError(f"{option} {path}: is a folder; name a file in it")
        _check_folder(option, path)
    for option, path in _named(args, FOLDERS):
        if path.exists() and not path.is_dir():
            raise OutputError(f"{option} {path}: is a file; name a folder")
        _check_folder(option, path)


def _named(args: argparse.Namespace, options: tuple[str, ...]) -> Iterator[tuple[str, Path]]:
    for name in options:
        value = getattr(args, name, None)
        if value is not None:
            yield f"--{name.removesuffix('_file').replace('_', '-')}", Path(value)


def _check_folder(option: str, path: Path) -> None:
    folder = path.parent
    if not folder.is_dir():
        raise OutputError(f"{option} {path}: there is no folder {folder}; make it first, or name another place")
    if not os.access(path if path.exists() else folder, os.W_OK):
        raise OutputError(f"{option} {path}: may not be written; name another file")
