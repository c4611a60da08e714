"""Bench files for tests, with the shipped site and the device in the simulator's own time."""

from dataclasses import replace
from pathlib import Path

import hil
from hil.bench import Bench, TargetKind, load_bench

BENCHES = Path(hil.__file__).parent / "benches"


def simulated(name: str = "simulated") -> Bench:
    """A bench that ships, with the device in this process and in virtual time."""
    bench = load_bench(BENCHES / f"{name}.toml")
    return replace(bench, targets=tuple(replace(target, kind=TargetKind.SIMULATED) for target in bench.targets))


def write_bench(directory: Path, targets: str) -> Path:
    """A bench file beside the shipped site; ``targets`` is what follows the head."""
    (directory / "bench.toml").write_text((BENCHES / "bench.toml").read_text())
    file = directory / "mine.toml"
    file.write_text(f'[bench]\nname = "mine"\nsite = "bench.toml"\n\n{targets}')
    return file
