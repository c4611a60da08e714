"""A board in another's place: the same machine, with its files, its keys, and a journal that says what it may do."""

import asyncio
import shutil
import tomllib
from pathlib import Path

from deploy.wheels import DeployError
from onboard.bounded_file import MOST_TEXT, read_bounded
from onboard.config.machine import load_machine
from onboard.core.site import journal_owner
from onboard.io.journal import FILE_NAME, MOST_BYTES, FileJournal

#: Of the dead board's boot partition, beside the two files that the machine file and the site are in: keys.
_KEYS = ("*.pem", "*.key", "*.crt")


def write_replacement(card: Path, journal: Path | None, to: Path) -> list[str]:
    """Write what the new board's boot partition needs into a folder; lines for a person.

    ``card`` is the old boot partition, or the folder it was written from; ``journal`` the old board's journal folder,
    None where it cannot be read. Raises ``ConfigError``, ``DeployError`` for a journal that is not this machine's or
    not whole, and ``OSError``.
    """
    config = load_machine(card / "machine.toml")
    name = config.machine.name
    folder = to / name
    if (folder / "journal").exists():
        raise DeployError(f"{folder}: holds a journal already, and two boards may not have one; name another --out")
    folder.mkdir(parents=True, exist_ok=True)
    site = card / tomllib.loads(read_bounded(config.file).decode("utf-8-sig"))["machine"]["site"]
    files = [config.file, site, *(file for form in _KEYS for file in sorted(card.glob(form)))]
    for file in files:
        _copy(file, folder / file.name)
    lines = [str(folder / file.name) for file in files]
    if journal is None:
        return [
            *lines,
            f"{name} has no journal: it holds until a person has regenerated its rights: docs/operate.md, regenerate",
        ]
    records = _take_over(journal, folder / "journal", journal_owner(config.site, config.machine))
    return [*lines, f"{folder / 'journal'}: {records} records of {name}, in order; the old board must not start again"]


def _take_over(journal: Path, to: Path, owner: str) -> int:
    """Copy a journal and read it as the new board will; how many records it has."""
    if not (journal / FILE_NAME).is_file():
        raise DeployError(f"{journal}: holds no {FILE_NAME}; name the journal's folder, or leave --journal out")
    to.mkdir()
    try:
        _copy(journal / FILE_NAME, to / FILE_NAME, MOST_BYTES)
        copy = FileJournal(to, owner)
        records = len(copy.replay())
        asyncio.run(copy.close())
        if not copy.condition.is_reliable:
            raise DeployError(
                f"{journal}: {copy.condition.why}; leave --journal out, and regenerate the machine's rights"
            )
    except DeployError:
        shutil.rmtree(to)
        raise
    (to / "lock").unlink(missing_ok=True)
    return records


def _copy(file: Path, to: Path, most_bytes: int = MOST_TEXT) -> None:
    try:
        to.write_bytes(read_bounded(file, most_bytes))
    except OSError as error:
        raise DeployError(f"{file}: {error.strerror}; name the old board's boot partition and journal") from error
