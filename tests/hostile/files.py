"""Files that somebody hands us to do harm, each with the command that reads it."""

import os
import struct
import zlib
from collections.abc import Iterator
from hashlib import blake2s
from pathlib import Path
from typing import NamedTuple

from bus_sim.sites import site_text

_MACHINE = '[machine]\nname = "MR1"\nsite = "{site}"\n[fleet_bus]\ninterface = "virtual"\nchannel = "f"\n'
_LOG = b"(1795219200.000000) fleet 18FF0201#08C3\n"


class Hostile(NamedTuple):
    """A file, and the ``command`` that reads it under the name ``{}``.

    ``content`` None is a pipe that never ends, a path a device, a number so many bytes that are holes.

    A ``suffix`` that begins with a stroke is its name in a folder, and ``{}`` is that folder.
    """

    name: str
    command: str
    content: bytes | Path | int | None
    suffix: str = ""


ZERO = Path("/dev/zero")
#: So many bytes of a file that has none.
_HOLES = 5_000_000_000
DEEP = b"[" * 50_000
DOTS = b"a." * 50_000 + b"a = 1\n"
HUGE = b"9" * 100_000
_SITE = "bus-sim sites {}"
_ONBOARD = "onboard --machine {} --check"
_SCENARIO = "bus-sim run --scenario {}"
_SESSIONS = "bus-sim run small --sessions {}"
_COUNTS = "bus-sim run small --counts {}"
_MAPPING = "bus-sim run small --sessions sessions.csv --mapping {}"
_CHECK = "onboard trace check {} --site small"
_DUMP = "onboard trace dump {} --decode --site small"
_KEYS = "onboard trace check log --site small --keys {}"
_DBC = "onboard trace dump log --decode --dbc {}"
_IMPORT = "bus-sim import {} -o site.toml"
_SPOOL = "onboard gateway -i virtual -c f --site small --mqtt mqtt://127.0.0.1:9 --spool {}"
_GATEWAY = "onboard gateway -i virtual -c f --site small --mqtt mqtt://127.0.0.1:9"


def hostile() -> Iterator[Hostile]:
    """The table."""
    small = site_text("small").encode()
    # Site files.
    yield Hostile("site: nested arrays", _SITE, b"x = " + DEEP, ".toml")
    yield Hostile("site: nested tables", _SITE, b"x = " + b"{a=" * 20_000, ".toml")
    yield Hostile("site: a key of 50,000 parts", _SITE, DOTS, ".toml")
    yield Hostile("site: a number of 100,000 digits", _SITE, small.replace(b"\n", b"\nx = " + HUGE + b"\n", 1), ".toml")
    yield Hostile(
        "site: a hexadecimal number of 1 MB",
        _SITE,
        small.replace(b"count = 3", b"count = 0x" + b"f" * 1_000_000),
        ".toml",
    )
    yield Hostile("site: NUL bytes", _SITE, b"\0" * 1_000_000, ".toml")
    yield Hostile("site: Latin-1", _SITE, 'name = "Gar\xe4ge"\n'.encode("latin-1"), ".toml")
    yield Hostile("site: UTF-16", _SITE, small.decode().encode("utf-16"), ".toml")
    yield Hostile("site: endless", _SITE, ZERO)
    yield Hostile("site: a pipe that never ends", _SITE, None)
    yield Hostile("site: 40 MB of comments", _SITE, b"# nothing\n" * 4_000_000, ".toml")
    yield Hostile("site: 100,000 tables", _SITE, small + b"[[lifts]]\n" * 100_000, ".toml")
    # What the parser takes, and who shows the value does not.
    nested = b"[" * 450 + b"]" * 450
    yield Hostile("site: nested 450 times", _SITE, small.replace(b'name = "small"', b"name = " + nested, 1), ".toml")
    yield Hostile("scenario: nested 450 times", _SCENARIO, b'[scenario]\nsite = "small"\nseed = ' + nested, ".toml")
    yield Hostile("keys: nested arrays", _KEYS, b"x = " + DEEP, ".keys")
    yield Hostile("keys: zeros without end", _KEYS, ZERO)
    yield Hostile("roles: nested arrays", _GATEWAY + " --orders 251 --roles {}", b"x = " + DEEP, ".toml")
    yield Hostile("roles: zeros without end", _GATEWAY + " --orders 251 --roles {}", ZERO)
    # Machine files, keys, journals.
    yield Hostile("machine file: nested", _ONBOARD, b"x = " + DEEP, ".toml")
    yield Hostile("machine file: endless", _ONBOARD, ZERO)
    yield Hostile("machine file: a pipe that never ends", _ONBOARD, None)
    yield Hostile("machine file: an endless site", _ONBOARD, _MACHINE.format(site="/dev/zero").encode(), ".toml")
    yield Hostile("machine file to commission: endless", "hil commission --machine {}", ZERO)
    yield Hostile("old board: nested", "deploy replace --card {} --out new", b"x = " + DEEP, "/machine.toml")
    yield Hostile("old journal: endless", "deploy replace --card card --journal {} --out new", _HOLES, "/journal.log")
    yield Hostile("journal: endless", _SPOOL, ZERO, "/journal.log")
    yield Hostile("journal: a pipe that never ends", _SPOOL, None, "/journal.log")
    yield Hostile("journal: nested", _SPOOL, _chained(DEEP), "/journal.log")
    yield Hostile("journal: 8,000,000 lines", _SPOOL, _chained(b"{}") + b"x\n" * 8_000_000, "/journal.log")
    yield Hostile("journal: 250,000 records", _SPOOL, bytes(2 * 4_096) + b"".join(_records(250_000)), "/journal.log")
    yield Hostile("key of updates: endless", "deploy image --key {} --out image", _HOLES)
    yield Hostile("boards' site: endless", "deploy machines {} --out machines", ZERO)
    yield Hostile("broker's password: endless", _GATEWAY + " --mqtt-password {}", ZERO)
    yield Hostile("broker's password: a pipe that never ends", _GATEWAY + " --mqtt-password {}", None)
    yield Hostile("authority: endless", _GATEWAY.replace("mqtt://", "mqtts://") + " --mqtt-ca {}", ZERO)
    yield Hostile("certificate: endless", _GATEWAY + " --mqtt-cert {} --mqtt-key log", ZERO)
    yield Hostile("certificate's key: endless", _GATEWAY + " --mqtt-cert log --mqtt-key {}", ZERO)
    yield Hostile(
        "served bus's token: endless",
        "bus-sim run small --one-car 60 --for 1 --serve 127.0.0.1:0 --serve-token {}",
        ZERO,
    )
    yield Hostile("page's token: a pipe that never ends", "onboard web log --site small --web 0 --web-token {}", None)
    # Scenarios, ledgers, counterexamples.
    yield Hostile("scenario: nested", _SCENARIO, b"x = " + DEEP, ".toml")
    yield Hostile("scenario: endless", _SCENARIO, ZERO)
    yield Hostile("scenario: a number of 100,000 digits", _SCENARIO, b'site = "small"\nseed = ' + HUGE, ".toml")
    yield Hostile("ledger: nested", "bus-sim campaign small --seeds 1-1 --add-to {}", b"{" + DEEP + b"\n", ".jsonl")
    yield Hostile("counterexample: nested", "bus-sim certify graph --play {}", DEEP, ".json")
    yield Hostile("counterexample: endless", "bus-sim certify graph --play {}", ZERO)
    # Who comes.
    yield Hostile("sessions: NUL bytes", _SESSIONS, b"arrival,departure\n" + b"\0" * 1_000_000, ".csv")
    yield Hostile("sessions: endless", _SESSIONS, ZERO)
    yield Hostile("sessions: a pipe that never ends", _SESSIONS, None)
    yield Hostile("sessions: a cell of 10 MB", _SESSIONS, b'arrival,departure\n"' + b"x" * 10_000_000, ".csv")
    yield Hostile("sessions: 1,000,000 columns", _SESSIONS, b"arrival," * 1_000_000 + b"\n", ".csv")
    yield Hostile("sessions: a zip", _SESSIONS, b"PK\x03\x04" + bytes(1_000), ".csv")
    yield Hostile(
        "counts: a number of 100,000 digits", _COUNTS, b"hour,arrivals,departures\n7," + HUGE + b",0\n", ".csv"
    )
    yield Hostile("mapping: nested", _MAPPING, b"x = " + DEEP, ".toml")
    # Logs and contracts.
    yield Hostile("log: endless", _CHECK, ZERO)
    yield Hostile("page's log: endless", "onboard web {} --site small --web 0", ZERO)
    yield Hostile("contract: endless", _CHECK.replace("{}", "log") + " --dbc {}", ZERO)
    yield Hostile("candump: a line of 300 MB", _CHECK, _LOG + b"(1795219200.0000", ".log")
    yield Hostile(
        "ASC: a line of 300 MB", _DUMP, b"date Sat Nov 21 00:00:00.000 am 2026\nbase hex timestamps absolute\n", ".asc"
    )
    yield Hostile("BLF: 1 GB in 1 MB", _DUMP, _blf_bomb(), ".blf")
    yield Hostile(
        "BLF: an object of 4 GB",
        _DUMP,
        _blf_head(160, 16) + struct.pack("<4sHHII", b"LOBJ", 16, 1, 0xFFFF_FFFF, 10),
        ".blf",
    )
    yield Hostile("TRC: a line of 300 MB", _DUMP, b";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,I,d,l,D\n", ".trc")
    yield Hostile(
        "pcapng: a block of 4 GB",
        _DUMP,
        struct.pack("<IIIHHq", 0x0A0D0D0A, 0xFFFF_FFF0, 0x1A2B3C4D, 1, 0, -1),
        ".pcapng",
    )
    yield Hostile("DBC: endless", _DBC, ZERO)
    yield Hostile("DBC: a pipe that never ends", _DBC, None)
    yield Hostile(
        "DBC: a signal of 10^9 bits",
        _DBC,
        b'VERSION ""\nBO_ 5 A: 8 X\n SG_ s : 0|1000000000@1+ (1,0) [0|0] "" X\n',
        ".dbc",
    )
    yield Hostile("DBC: nested", _DBC, b"BO_ " * 200_000, ".dbc")
    # Buildings of others.
    yield Hostile("YAML: nested arrays", _IMPORT, DEEP, ".yaml")
    yield Hostile("YAML: nested tables", _IMPORT, b"{a: " * 20_000, ".yaml")
    yield Hostile("YAML: nested by indentation", _IMPORT, b"\n".join(b" " * n + b"a:" for n in range(4_000)), ".yaml")
    yield Hostile("YAML: nested by dashes", _IMPORT, b"- " * 50_000, ".yaml")
    yield Hostile("YAML: a billion laughs", _IMPORT, _laughs(), ".yaml")
    yield Hostile("YAML: an object", _IMPORT, b"!!python/object/apply:os.system ['true']\n", ".yaml")
    yield Hostile("YAML: 2,000,000 values", _IMPORT, b"[" + b"1," * 2_000_000 + b"]", ".yaml")
    yield Hostile("XML: entities", _IMPORT, _entities(), ".xml")
    yield Hostile("XML: nested", _IMPORT, b"<a>" * 200_000, ".xml")
    yield Hostile(
        "XML: a file of this computer",
        _IMPORT,
        b'<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]><a>&x;</a>',
        ".xml",
    )
    yield Hostile("map: 10^9 cells wide", _IMPORT, b"type octile\nheight 1\nwidth 1000000000\nmap\n.\n", ".map")
    yield Hostile("map: a pipe that never ends", _IMPORT, None, ".map")
    yield Hostile("tasks: endless", "bus-sim import small.map {} -o site.toml", ZERO, ".task")


#: What is longer than it is worth keeping in memory: the suffix of its beginning, and how it goes on.
LONG = {".log": 300, ".asc": 300, ".trc": 300}


def made(one: Hostile, folder: Path, number: int) -> Path:
    """Its file."""
    path = folder / f"hostile-{number}{one.suffix}"
    path.parent.mkdir(exist_ok=True)
    if isinstance(one.content, int):
        path.touch()
        os.truncate(path, one.content)
    elif one.content is None:
        os.mkfifo(path)
    elif isinstance(one.content, Path):
        path.symlink_to(one.content)
    else:
        path.write_bytes(one.content)
        if one.suffix in LONG:
            # A hole reads as zeros and takes no room.
            os.truncate(path, LONG[one.suffix] * 1_000_000)
    return path


def _chained(record: bytes) -> bytes:
    """A journal without slots whose one line has the link that it should have."""
    return bytes(2 * 4_096) + b"".join(_records(1, record))


def _records(count: int, record: bytes = b"{}") -> Iterator[bytes]:
    link = b""
    for number in range(count):
        body = b"%d %s" % (number, record)
        link = blake2s(link + b" " + body, digest_size=8).hexdigest().encode()
        yield link + b" " + body + b"\n"


def _laughs() -> bytes:
    lines = [b"a0: &a0 [lol, lol]"]
    lines += [b"a%d: &a%d [%s]" % (n, n, b", ".join([b"*a%d" % (n - 1)] * 9)) for n in range(1, 12)]
    return b"\n".join(lines)


def _entities() -> bytes:
    said = b"".join(b'<!ENTITY e%d "%s">' % (n, b"&e%d;" % (n - 1) * 10) for n in range(1, 12))
    return b'<!DOCTYPE a [<!ENTITY e0 "lol">' + said + b"]><a>&e11;</a>"


def _blf_head(size: int, plain: int) -> bytes:
    return struct.pack(
        "<4sIBBBBBBBBQQII8H8H", b"LOGG", 144, 5, 0, 0, 0, 2, 6, 8, 1, size, plain, 1, 1, *[0] * 16
    ).ljust(144, b"\0")


def _blf_bomb() -> bytes:
    # What a megabyte of zeros adds is the same for the second and for all after it; packing each anew takes seconds.
    packer = zlib.compressobj(9)
    first, again = (packer.compress(bytes(1_000_000)) + packer.flush(zlib.Z_FULL_FLUSH) for _ in range(2))
    # The end is a last block and the sum of all (RFC 1950, Adler-32), which for n zeros is n mod 65521 and 1.
    packed = first + 999 * again + packer.flush()[:-4] + struct.pack(">HH", 1_000_000_000 % 65_521, 1)
    inner = struct.pack("<H6xI4x", 2, 1_000_000_000) + packed
    head = struct.pack("<4sHHII", b"LOBJ", 16, 1, 16 + len(inner), 10)
    whole = head + inner + bytes(len(inner) % 4)
    return _blf_head(144 + len(whole), 1_000_000_000) + whole
