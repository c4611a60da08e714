"""``bus-sim run --set``: a word of the site file for one run."""

from pathlib import Path

import pytest

from bus_sim.cli import main
from bus_sim.site_words import with_words
from bus_sim.sites import site_text
from onboard.config.site import parse_site
from onboard.systems.car_park.site import DeskPolicy, PlacePolicy, car_park


def test_a_word_stands_in_the_stead_of_the_files() -> None:
    words = ["negotiation.place=cost", "negotiation.desk=own", 'negotiation.place="stay"', "negotiation.promises=true"]
    site = car_park(parse_site(with_words(site_text("standard"), words), "standard.toml"))
    assert (site.place, site.desk, site.promises) == (PlacePolicy.STAY, DeskPolicy.OWN, True)
    again = with_words(with_words(site_text("standard"), words[:1]), ["floors.count=6", "negotiation.place=random"])
    site = car_park(parse_site(again, "standard.toml"))
    assert (site.place, len(site.places)) == (PlacePolicy.RANDOM, 230)


@pytest.mark.parametrize(
    ("word", "told"),
    [
        ("place=cost", "bus-sim: --set place=cost: write TABLE.KEY=VALUE"),
        ("negotiation.place=far", 'negotiation.place = "far": unknown word'),
        ("negotiation.palce=cost", "negotiation.palce"),
    ],
)
def test_a_mistake_is_one_line(word: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "small", "--set", word, "--trace", str(tmp_path / "log")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert told in line


def test_a_table_in_one_line_is_left_alone() -> None:
    with pytest.raises(ValueError, match="in one line"):
        with_words('negotiation = {place = "cost"}\n', ["negotiation.place=stay"])
