"""Sites with seals: they work as without, and a forger under a machine's own node-ID does them no harm."""

from pathlib import Path

import pytest

from bus_sim.attacks.trials import TrialSettings, run_attack
from bus_sim.systems.orders import OrderArrivals

SITES = Path(__file__).parents[2] / "bus_sim" / "sites"


def site_with(seals: str, folder: Path) -> str:
    text = (SITES / "graph.toml").read_text(encoding="utf-8")
    file = folder / f"{seals}.toml"
    file.write_text(text.replace("[site]\n", f'[site]\nseals = "{seals}"\n'), encoding="utf-8")
    return str(file)


@pytest.mark.parametrize(("seals", "is_harmless"), [("off", False), ("watch", False), ("required", True)])
def test_a_forger_under_a_machines_own_number_is_harmless_where_seals_are_required(
    seals: str, is_harmless: bool, tmp_path: Path
) -> None:
    plan = TrialSettings(site_with(seals, tmp_path), node=11, demand=OrderArrivals(3, 10.0))
    result = run_attack(plan, ("grant-asked", 1))
    assert result.is_harmless is is_harmless, result.why
