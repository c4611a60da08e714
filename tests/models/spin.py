"""SPIN: verify a variant of a model, or run a sequence of its steps. Skips where SPIN or a C compiler is missing."""

import re
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tests.thinned import is_long
from tests.tools import DEADLINE_S, require_tool

CORE = Path(__file__).parents[2] / "onboard" / "core"
TOKEN = CORE / "token.pml"
NEGOTIATION = CORE / "negotiation" / "negotiation.pml"
LIVENESS = ("-a", "-f")


class Verdict(NamedTuple):
    """What a check found: how many states it stored, its errors (it ends at the first), and the way to it."""

    states: int
    errors: int
    report: str
    trail: str


def _run(folder: Path, *command: str) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
    assert done.returncode == 0, f"{' '.join(command)}\n{done.stdout}{done.stderr}"
    return done.stdout


def verify(folder: Path, model: Path, *defines: str, is_liveness: bool = False) -> Verdict:
    """All states of a model with these macros (``NAME`` or ``NAME=value``): safety, or liveness under weak fairness."""
    spin, compiler = require_tool("spin"), require_tool("gcc")
    macros = [f"-D{one}" for one in defines]
    _run(folder, spin, *macros, "-a", str(model))
    kind = ("-DNFAIR=12",) if is_liveness else ("-DSAFETY", "-DNOCLAIM")
    # What there are few states of is compiled longer than it runs.
    level = "-O2" if is_long() else "-O0"
    _run(folder, compiler, level, "-w", "-DCOLLAPSE", "-DMEMLIM=3000", *kind, "-o", "pan", "pan.c")
    report = _run(folder, "./pan", "-m200000", *(LIVENESS if is_liveness else ()))
    stored = re.search(r"(\d+) states, stored", report)
    found = re.search(r"errors: (\d+)", report)
    assert stored is not None and found is not None, report
    assert "max search depth too small" not in report, report
    errors = int(found[1])
    trail = _run(folder, spin, *macros, "-k", f"{model.name}.trail", "-p", str(model)) if errors else ""
    return Verdict(int(stored[1]), errors, report, trail)


def first_refused(folder: Path, model: Path, steps: Sequence[str], begin: str, *defines: str) -> str | None:
    """The first step that the model does not allow after those before it; None where it allows all.

    ``steps`` are calls of the model's inlines; ``begin`` are statements that make the first state.
    """
    spin = require_tool("spin")
    macros = "".join(f"#define {one.replace('=', ' ')}\n" for one in (*defines, "TRACE"))
    body = "".join(f'    {step}; printf("did {number}\\n");\n' for number, step in enumerate(steps))
    text = f'{macros}#include "{model}"\ninit {{\n    {begin};\n{body}    printf("conforms\\n")\n}}\n'
    (folder / "run.pml").write_text(text, encoding="utf-8")
    done = subprocess.run(
        (spin, "-T", "run.pml"), cwd=folder, capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )
    if "conforms" in done.stdout:
        return None
    assert "syntax error" not in done.stdout, done.stdout
    return steps[len(re.findall(r"did \d+", done.stdout))]
