"""``python -m tests.protocol``: charts and times of docs/protocol.md from the code."""

from tests.protocol.page import write

if __name__ == "__main__":
    write()
