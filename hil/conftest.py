"""``pytest hil --bench FILE``: every scenario on every target of a bench, its figures in the report, its trace kept."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from hil.bench import Bench, Target, load_bench
from hil.scenarios.registry import SCENARIOS
from hil.scenarios.scenario import BenchScenario
from onboard.config.problems import ConfigError

#: Where everything but the controller is simulated.
DEFAULT_BENCH = Path(__file__).parent / "benches" / "simulated.toml"
#: Figures that are told after a run, with their worst case over all tests.
_WORST = "_worst_us"
_BENCH = pytest.StashKey[Bench]()


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options of a bench."""
    group = parser.getgroup("hil", "a device under test in a simulated fleet")
    group.addoption(
        "--bench",
        type=Path,
        default=DEFAULT_BENCH,
        metavar="FILE",
        help="bench file (default: the controller as a process; hil/benches/board.toml is a template for a board)",
    )
    group.addoption(
        "--traces",
        type=Path,
        default=None,
        metavar="DIR",
        help="where each test leaves its candump log, in a directory of its own (default: runs/hil)",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Read the bench file once. Raises ``UsageError`` with every mistake in it."""
    try:
        config.stash[_BENCH] = load_bench(config.getoption("--bench"))
    except ConfigError as error:
        raise pytest.UsageError(str(error)) from error


@pytest.fixture(scope="session")
def bench(pytestconfig: pytest.Config) -> Bench:
    """The bench of this run."""
    return pytestconfig.stash[_BENCH]


@pytest.fixture
def place(request: pytest.FixtureRequest, pytestconfig: pytest.Config) -> Path:
    """The empty directory in which this test leaves its trace."""
    root: Path = pytestconfig.getoption("--traces") or pytestconfig.rootpath / "runs" / "hil"
    name = "".join(letter if letter.isalnum() else "-" for letter in request.node.callspec.id)
    directory = root / name
    _empty(directory)
    return directory


def _empty(directory: Path) -> None:
    directory.mkdir(parents=True, exist_ok=True)
    for entry in directory.iterdir():
        if entry.is_dir():
            _empty(entry)
            entry.rmdir()
        else:
            entry.unlink()


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """A test for every scenario that a target's kind of machine can play."""
    if "scenario" in metafunc.fixturenames:
        found = list(_tests(metafunc.config.stash[_BENCH]))
        names = [f"{target.machine.name} {scenario.name}" for target, scenario in found]
        metafunc.parametrize(("target", "scenario"), found, ids=names)


def _tests(bench: Bench) -> Iterator[tuple[Target, BenchScenario]]:
    for target in bench.targets:
        for scenario in SCENARIOS:
            if not scenario.kinds or target.machine.kind in scenario.kinds:
                yield target, scenario


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """The worst case of every latency that was measured, and where."""
    worst: dict[str, tuple[int, str]] = {}
    for reports in terminalreporter.stats.values():
        for report in reports:
            for name, value in getattr(report, "user_properties", ()):
                if name.endswith(_WORST) and isinstance(value, int):
                    worst[name] = max(worst.get(name, (0, "")), (value, report.nodeid.partition("[")[2].rstrip("]")))
    for name, (value, where) in sorted(worst.items()):
        what = name.removesuffix(_WORST).replace("_", " ")
        terminalreporter.write_line(f"bench {config.stash[_BENCH].name}: {what}: worst {value / 1000:.1f} ms ({where})")
