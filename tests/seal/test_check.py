"""``onboard trace check --keys``: a log is judged by what counted on its bus, and what did not is told."""

from pathlib import Path

import pytest

from bus_sim.cli import main as bus_sim
from bus_sim.seals import SimulatedSeals
from onboard.cli import main
from onboard.config.keys import key_text
from onboard.config.site import load_site
from onboard.systems.contract import codecs_for
from tests.seal.test_site import site_with


def test_forged_frames_of_a_log_are_told_and_not_judged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    site_file, log, keys = site_with("required", tmp_path), tmp_path / "run.log", tmp_path / "a.keys"
    forger = "attack:name=grant-asked,at_s=20,for_s=20,node=11"
    assert bus_sim(["run", site_file, "--for", "60", "--trace", str(log), "--fault", forger]) in (0, 1)
    site = load_site(Path(site_file))
    keys.touch(mode=0o600)
    drawn = SimulatedSeals(site, 1, codecs_for(site).fleet.decode_part).keys(11)
    keys.write_text(key_text(drawn, site.name, "R1", "").replace("made = 0", "made = 1"), encoding="utf-8")
    words = ["trace", "check", str(log), "--site", site_file]
    assert main(words) == 1
    capsys.readouterr()
    assert main([*words, "--keys", str(keys)]) == 0
    assert "under R1's number without a seal" in capsys.readouterr().out
    assert main([*words[:-1], "graph", "--keys", str(keys)]) == 2
    assert "needs --site with the file of a site that has seals" in capsys.readouterr().err
