"""The import table of the design holds in the sources, and the checker itself notices what it should."""

from pathlib import Path

import pytest

from tests.project.layers import LAYERS, check_tree, layer_of

ROOT = Path(__file__).parents[2]


def test_no_file_imports_what_its_layer_may_not() -> None:
    breaches = check_tree(ROOT)
    assert not breaches, "\n".join(breaches)


def test_the_sources_are_there_to_be_checked() -> None:
    packages = {name for name in LAYERS if name.startswith("onboard.")}
    places = [ROOT / name.replace(".", "/") for name in sorted(packages | {"bus_sim", "dbc", "hil"})]
    assert all(place.is_dir() or place.with_suffix(".py").is_file() for place in places)


def test_every_package_of_onboard_has_a_line_in_the_table() -> None:
    for file in sorted((ROOT / "onboard").rglob("*.py")):
        parts = file.relative_to(ROOT).with_suffix("").parts
        assert layer_of(".".join(parts[:-1] if parts[-1] == "__init__" else parts)) in LAYERS


def tree(root: Path, sources: dict[str, str]) -> Path:
    """A small source tree: the files given, and an empty ``__init__.py`` in each of their packages."""
    for name in ("onboard/contract/messages.py", "onboard/ways/sipp.py", "onboard/trace/candump.py", *sources):
        file = root / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(sources.get(name, ""), encoding="utf-8")
        folder = file.parent
        while folder != root:
            (folder / "__init__.py").touch()
            folder = folder.parent
    return root


WRONG = [
    ("onboard/core/a.py", "import asyncio"),
    ("onboard/core/a.py", "import time"),
    ("onboard/core/a.py", "import logging"),
    ("onboard/core/a.py", "from random import Random"),
    ("onboard/core/a.py", "from pathlib import Path"),
    ("onboard/core/a.py", "import os.path"),
    ("onboard/core/a.py", "from onboard.wire import codec"),
    ("onboard/core/a.py", "from onboard import wire"),
    ("onboard/core/a.py", "from ..wire import codec"),
    ("onboard/core/deep/a.py", "from ...wire import codec"),
    ("onboard/core/a.py", "import numpy"),
    ("onboard/core/a.py", "print('decided')"),
    ("onboard/core/a.py", "order = sorted([], key=lambda one: id(one))"),
    ("onboard/core/a.py", "first = min([], key=id)"),
    ("onboard/systems/cell/a.py", "draw = hash('seed') % 6"),
    ("onboard/core/a.py", "def f() -> None:\n    import socket"),
    ("onboard/core/a.py", "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from onboard.io import pycan"),
    ("onboard/core/a.py", "from importlib import import_module"),
    ("onboard/systems/cell/a.py", "from onboard.wire import codec"),
    ("onboard/systems/cell/a.py", "import random"),
    ("onboard/wire/codec.py", "import cantools"),
    ("onboard/wire/codec.py", "from onboard.core import sipp"),
    ("onboard/wire/codec.py", "from onboard.ways.sipp import plan_route"),
    ("onboard/wire/dbc_file.py", "import can"),
    ("onboard/ports/bus.py", "from onboard.controller import shell"),
    ("onboard/config/site.py", "from onboard.wire import codec"),
    ("onboard/controller/shell.py", "from onboard.io import pycan"),
    ("onboard/controller/shell.py", "from onboard.systems import registry"),
    ("onboard/controller/shell.py", "import time"),
    ("onboard/io/pycan.py", "from onboard.controller import shell"),
    ("onboard/io/journal.py", "import can"),
    ("onboard/io/pycan.py", "import cantools"),
    ("onboard/io/pycan.py", "import bus_sim.can"),
    ("onboard/cli.py", "import onboard.trace.candump"),
    ("onboard/cli.py", "from onboard import trace"),
    ("onboard/cli.py", "from onboard.trace import candump"),
    ("onboard/cli.py", "from bus_sim import run"),
    ("onboard/cli.py", "from importlib import import_module\nimport_module('bus' + '_sim')"),
    ("onboard/cli.py", "import tests.tools"),
    ("onboard/trace/page.py", "from onboard.controller import shell"),
    ("onboard/trace/page.py", "from onboard.core import sipp"),
    ("onboard/trace/page.py", "from onboard.ports.bus import Bus"),
    ("dbc/__init__.py", "from onboard.contract import messages"),
    ("dbc/__init__.py", "import cantools"),
    ("bus_sim/run.py", "import can"),
    ("bus_sim/run.py", "import hil"),
    ("bus_sim/run.py", "import tests.tools"),
    ("bus_sim/run.py", "import threading"),
    ("hil/board.py", "import tests.tools"),
]


@pytest.mark.parametrize(
    ("file", "source"), WRONG, ids=[f"{file}: {source.splitlines()[-1]}" for file, source in WRONG]
)
def test_a_wrong_import_is_reported_with_its_file(tmp_path: Path, file: str, source: str) -> None:
    breaches = check_tree(tree(tmp_path, {file: source, "onboard/wire/b.py": "", "onboard/io/b.py": ""}))
    assert len(breaches) == 1
    assert breaches[0].startswith(f"{file}:{len(source.splitlines())}: ")


RIGHT = {
    "onboard/core/a.py": "from onboard.contract.messages import Message\nimport heapq",
    "onboard/core/b.py": "from . import messages\nfrom .sipp import plan_route\nkept = {id(b): b for b in ()}",
    "onboard/systems/cell/a.py": "from onboard.ways.sipp import plan_route",
    "onboard/wire/dbc_file.py": "import cantools\nfrom dbc import fleet_dbc_text",
    "onboard/wire/codec.py": "from onboard.contract import messages\nfrom onboard.wire import dbc_file",
    "onboard/ports/bus.py": "from typing import Protocol\nfrom onboard.contract.messages import Message",
    "onboard/config/site.py": "import tomllib\nfrom pathlib import Path\nfrom onboard.ways.sipp import plan_route",
    "onboard/controller/shell.py": "import asyncio\nfrom onboard.core import sipp\nimport onboard.wire.codec",
    "onboard/io/pycan.py": "import can\nimport threading\nfrom onboard.ports.bus import Bus",
    "onboard/io/mqtt.py": "import aiomqtt",
    "onboard/trace/page.py": "from onboard.trace.candump import read\nfrom onboard.wire.codec import Codec",
    "onboard/cli.py": "import asyncio\nfrom onboard import __version__\nfrom onboard.io.pycan import PythonCanBus",
    "onboard/__main__.py": "from onboard.cli import main",
    "dbc/__init__.py": "from importlib.resources import files",
    "bus_sim/run.py": "import rich.live\nfrom onboard.trace import candump\nimport onboard.controller.shell",
    "hil/board.py": "from bus_sim.run import run\nimport pytest",
}


def test_what_the_table_allows_is_not_reported(tmp_path: Path) -> None:
    assert check_tree(tree(tmp_path, RIGHT)) == []


def test_a_package_without_a_line_in_the_table_is_refused(tmp_path: Path) -> None:
    with pytest.raises(KeyError, match=r"onboard\.helpers: no layer"):
        check_tree(tree(tmp_path, {"onboard/helpers/a.py": ""}))
