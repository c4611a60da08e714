"""What a file may be that is no log of ours, told from its first bytes: a guess, with what to do about it."""

import re

#: Beginnings of files that people take for logs, or name by mistake; the first that fits.
_BEGINNINGS: tuple[tuple[bytes, str], ...] = (
    (b"MDF ", "an ASAM MDF measurement; export it as Vector ASC with the tool that wrote it"),
    (b"SQLite format 3", "a database, perhaps of python-can; write it anew as ASC: can_logconvert LOG LOG.asc"),
    (b"timestamp,", "python-can's CSV; write it anew as ASC: can_logconvert LOG LOG.asc"),
    *(
        (magic, "a pcap capture; write it anew as pcapng: editcap -F pcapng LOG LOG.pcapng")
        for magic in (b"\xd4\xc3\xb2\xa1", b"\xa1\xb2\xc3\xd4", b"\x4d\x3c\xb2\xa1", b"\xa1\xb2\x3c\x4d")
    ),
    (b"\x1f\x8b", "packed by gzip; unpack it first"),
    (b"\xfd7zXZ", "packed by xz; unpack it first"),
    (b"\x28\xb5\x2f\xfd", "packed by zstd; unpack it first"),
    (b"BZh", "packed by bzip2; unpack it first"),
    (b"PK\x03\x04", "a zip archive; unpack it first"),
    (b"\x7fELF", "a program; name a log"),
    (b'VERSION "', "a DBC file; name a log"),
    (b"{", "JSON; name a log"),
    (b"<", "XML or HTML; name a log"),
)
#: candump's and cansend's lines without the marks of ``-L``: what people see on a screen.
_SCREEN = re.compile(rb"\s*(\(\d+\.\d+\)\s+)?\S+\s+[0-9A-Fa-f]{3,8}\s+\[\d+\]")
_TOML = re.compile(rb"\s*(\[\[?[A-Za-z_.]+\]\]?|[A-Za-z_]+\s*=)")
_LONGEST_SHOWN = 40
#: So much of a first line is looked at, bytes.
_MOST_HEAD = 4_096


def guess(head: bytes) -> str:
    """A guess from a file's first line (or first bytes), as one clause with a remedy."""
    for beginning, what in _BEGINNINGS:
        if head.startswith(beginning):
            return f"it looks like {what}"
    head = head[:_MOST_HEAD]
    if _SCREEN.match(head):
        return "it looks like what candump shows on a screen; record with candump -L, or -l"
    if _TOML.match(head):
        return "it looks like TOML, perhaps a site file; name a log"
    if b"\0" in head:
        return "it is binary, of no format that we know; name a log"
    first = head.decode("utf-8", "replace").strip()
    shown = first if len(first) <= _LONGEST_SHOWN else first[: _LONGEST_SHOWN - 3] + "..."
    return f'it is text that begins with "{shown}"; name a log' if shown.isprintable() else "name a log"
