"""Reading a file that a person wrote."""

from pathlib import Path

from onboard.bounded_file import MOST_TEXT, read_bounded
from onboard.config.problems import ConfigError, Problem, Problems
from onboard.config.reader import TomlTable
from onboard.config.toml_lines import parse


def read_text(path: Path, what: str, most_bytes: int = MOST_TEXT) -> str:
    """The text of a UTF-8 file, with or without a byte-order mark. Raises ``ConfigError`` with one problem."""
    try:
        # Ends of lines as ``open`` gives them: whoever compares with what a file says has ``\n``.
        return read_bounded(path, most_bytes).decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except FileNotFoundError:
        why = "does not exist"
    except UnicodeDecodeError:
        why = "is not UTF-8 text"
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        why = f"cannot be read ({getattr(error, 'strerror', None) or error})"
    raise ConfigError([Problem(str(path), 0, "", None, why, f"name an existing {what} file")])


def root_table(text: str, problems: Problems) -> TomlTable:
    """The whole document as a table. Raises ``ConfigError`` where the text is not TOML."""
    document = parse(text, problems.file, problems)
    problems.raise_if_any()
    return TomlTable(document, problems, (), document.values)
