"""Files that a command line asks for, looked at before anything runs: hours do not end at a mistyped name."""

import argparse
import os
from collections.abc import Iterator
from pathlib import Path

from onboard.bounded_file import is_folder, is_there

#: Options of all commands that name a file to be written, and those that name a folder.
FILES = ("trace", "json", "counterexample", "output", "add_to", "out_file", "draw")
FOLDERS = ("out", "process_dir")


class OutputError(ValueError):
    """A file that cannot be written: the option, the value and the remedy in one line."""


def check_outputs(args: argparse.Namespace) -> None:
    """Raise ``OutputError`` for a file whose folder is not there or may not be written to, or that is a folder."""
    for option, path in _named(args, FILES):
        if is_folder(path):
            raise OutputError(f"{option} {path}: is a folder; name a file in it")
        _check_folder(option, path)
    for option, path in _named(args, FOLDERS):
        if is_there(path) and not is_folder(path):
            raise OutputError(f"{option} {path}: is a file; name a folder")
        _check_folder(option, path)


def _named(args: argparse.Namespace, options: tuple[str, ...]) -> Iterator[tuple[str, Path]]:
    for name in options:
        value = getattr(args, name, None)
        if value is not None:
            yield f"--{name.removesuffix('_file').replace('_', '-')}", Path(value)


def _check_folder(option: str, path: Path) -> None:
    folder = path.parent
    try:
        path.stat()
    except (FileNotFoundError, NotADirectoryError):
        pass
    except OSError as error:
        raise OutputError(f"{option} {path}: {error.strerror}; name another file") from error
    if not is_folder(folder):
        raise OutputError(f"{option} {path}: there is no folder {folder}; make it first, or name another place")
    if not os.access(path if is_there(path) else folder, os.W_OK):
        raise OutputError(f"{option} {path}: may not be written; name another file")
