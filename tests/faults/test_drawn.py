"""Sites drawn by chance are played as a campaign plays shipped ones, and are the same wherever they are drawn."""

from pathlib import Path

import pytest

from bench.drawn import DRAWN, drawn_site, main
from onboard.config.site import parse_site


@pytest.mark.parametrize("system", DRAWN)
def test_drawn_sites_are_served_under_faults(system: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["14-15", "--system", system, "--cars", "8", "--out", str(tmp_path)]) == 0
    first, second, last = capsys.readouterr().out.splitlines()
    assert (first[:8], second[:8], last) == ("site 14:", "site 15:", "2 sites, 0 failed")
    assert list(tmp_path.iterdir()) == [], "nothing is kept of what did not fail"


@pytest.mark.parametrize("system", DRAWN)
def test_a_number_is_one_site(system: str) -> None:
    one, other = drawn_site(system, 3), drawn_site(system, 4)
    assert one == drawn_site(system, 3) != other
    assert parse_site(one, "d3.toml").name == "d3"
    assert parse_site(one, "d3.toml").system == ("car-park" if system == "lines" else system)
