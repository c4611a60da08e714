"""``python -m tests.sizes``: lines of each system, and lines of tests that concern it alone.

Those are its folders under tests; the tests of every system count once for each, as each case of them plays that
system. The docs and what is shared are nobody's.
"""

from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
#: A system's tests are at least so much of its own lines.
LEAST = 0.5
#: Folders of tests that concern the car park alone: it was there before there were systems.
CAR_PARK = ("car_park", "compare", "demand", "design", "kinds", "plant", "system", "ways")


class Size(NamedTuple):
    """Lines of a system, of its own tests, and of those of every system."""

    system: str
    lines: int
    own: int
    common: int

    @property
    def share(self) -> float:
        """Tests for each line."""
        return (self.own + self.common) / self.lines


def _lines(*folders: Path) -> int:
    files = (path for folder in folders for path in folder.rglob("*.py"))
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in files)


def sizes() -> list[Size]:
    """One for each system that ships."""
    found, tests = [], ROOT / "tests"
    common = _lines(tests / "conformance")
    for folder in sorted((ROOT / "onboard" / "systems").glob("*/system.py")):
        name = folder.parent.name
        own = CAR_PARK if name == "car_park" else (name,)
        lines = _lines(folder.parent, ROOT / "bus_sim" / "systems" / name)
        found.append(Size(name, lines, _lines(*(tests / one for one in own)), common))
    return found


def main() -> None:
    """The table."""
    print(f"{'system':<10} {'lines':>7} {'own tests':>10} {'of all':>7} {'share':>6}")
    for one in sizes():
        print(f"{one.system:<10} {one.lines:>7} {one.own:>10} {one.common:>7} {one.share:>6.2f}")


if __name__ == "__main__":
    main()
