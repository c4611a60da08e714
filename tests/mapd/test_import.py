"""Files of others become sites that run; what is not carried over is named; mistakes get a line and leave no file."""

import json
from pathlib import Path

import pytest

import bus_sim
from bus_sim.cli import main
from onboard.cli import main as onboard_main
from onboard.config.site import load_site
from onboard.systems import registry
from onboard.systems.mapd.site import Mapd
from onboard.systems.system import System

DATA = Path(bus_sim.__file__).parent / "data"
DEMO = DATA / "plants" / "Demo-01.xml"
HOTEL = DATA / "plants" / "hotel.building.yaml"
RANDOM = DATA / "mapd" / "random-32-32-20.map"


def imported(tmp_path: Path, *arguments: str | Path) -> Mapd:
    output = tmp_path / "site.toml"
    assert main(["import", *(str(one) for one in arguments), "-o", str(output)]) == 0
    site = load_site(output)
    assert isinstance(site, Mapd)
    return site


def runs(tmp_path: Path) -> dict[str, int]:
    summary = tmp_path / "summary.json"
    assert main(["run", str(tmp_path / "site.toml"), "--json", str(summary)]) == 0
    found: dict[str, int] = json.loads(summary.read_text())
    return found


def test_p59_an_opentcs_model_becomes_a_site_that_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    site = imported(tmp_path, DEMO)
    said = capsys.readouterr().out
    assert (len(site.points), len(site.lines), len(site.robots), len(site.zones)) == (59, 75, 4, 2)
    assert all(line.one_way for line in site.lines)
    assert site.step_ms == 2_000
    first = next(line for line in site.lines if (line.start, line.end) == ("Point-0057", "Point-0058"))
    assert first.steps == 5, "10,000 mm at 1,000 mm/s in steps of two seconds"
    assert "not carried over: location Fire door 01: no point is linked to it" in said
    assert "not carried over: peripheral operation Open Fire door 01 on path Point-0057 --- Point-0058" in said
    assert said.count("envelopes of p") == 12
    assert runs(tmp_path)["served"] == 20


def test_p59_the_hotel_with_two_lifts_becomes_a_site_that_runs(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site = imported(tmp_path, HOTEL)
    said = capsys.readouterr().out
    names = {site.floor.names[cell] for cell in site.endpoints}
    assert {"L1/lobby", "L1/kitchen", "L2/L2_room1"} <= names
    assert any(name.startswith("L3/") for name in names)
    assert sorted(machine.name for machine in site.machines.values())[:2] == ["Desk", "cleanerBotA_1"]
    assert len(site.zones) == 2
    for zone in site.zones:
        cells = {site.floor.names.index(name) for name in zone if ">" not in name}
        assert len(cells) == 3
        assert len({site.floor.resources[cell] for cell in cells}) == 1
    assert "not carried over: empty travel and doors of lift Lift1" in said
    assert "not carried over: is_charger at L1/tinybot_charger: robots do not run empty" in said
    assert runs(tmp_path)["served"] == 20


def test_a_map_without_homes_gets_them_where_they_shut_nobody_in(tmp_path: Path) -> None:
    site = imported(tmp_path, RANDOM, "--robots", "6", "--tasks", "12")
    assert len(site.homes) == 6
    assert len(site.rests) >= 6
    assert runs(tmp_path)["served"] == 12


def test_a_map_and_its_tasks_go_together(tmp_path: Path) -> None:
    folder = DATA / "mapd"
    site = imported(tmp_path, folder / "kiva-2.task", folder / "kiva-10-500-5.map", "--robots", "3")
    assert (len(site.homes), len(site.tasks), len(site.endpoints)) == (3, 500, 302)


def test_the_same_files_and_seed_give_the_same_text(tmp_path: Path) -> None:
    texts = []
    for name in ("a.toml", "b.toml"):
        assert main(["import", str(HOTEL), "-o", str(tmp_path / name), "--seed", "7"]) == 0
        texts.append((tmp_path / name).read_text())
    assert texts[0] == texts[1]


MISTAKES = {
    "short.map": ("...\n..\n", ':2: row = "..": 2 cells; write 3, as in other rows'),
    "first.map": ("..\n...\n...\n", ':1: row = "..": 2 cells; write 3, as in other rows'),
    "odd.map": ("...\n.x.\n", ':2: cell = "x": unknown; write'),
    "size.map": ("type octile\nheight 3\nwidth 2\nmap\n..\n..\n", ':2: height = "3": the map has 2; write height 2'),
    "no_homes.map": (".e.\n.e.\n", ": r: endpoints, but no robots' homes; mark the homes by r"),
    "narrow.map": (
        "...\n",
        ": robots = 4: no room for so many to stay without shutting others in; ask for fewer robots",
    ),
    "empty.map": ("", ":1: no map; write the rows of cells"),
    "cut.xml": ("<model><point name='A'>", ":1: not usable XML: no element found; export the model again"),
    "bomb.xml": ("<!DOCTYPE m [<!ENTITY a 'a'>]><m>&a;</m>", ":1: not usable XML: a document type declaration"),
    "other.xml": ("<plan/>", ":1: plan: not a plant model; give an XML file whose root is <model>"),
    "path.xml": (
        "<model><point name='A'/>\n<path name='P' sourcePoint='A' destinationPoint='B' length='1'/>\n"
        "<vehicle name='V' length='1' maxVelocity='1'/></model>",
        ':2: path destinationPoint = "B": names nothing in the model; ',
    ),
    "arrow.xml": (
        "<model><point name='A>'/><path name='P' sourcePoint='A>' destinationPoint='A>' length='1'/>\n"
        "<vehicle name='V' length='1' maxVelocity='1'/></model>",
        ':1: point name = "A>": has a >, which joins names here; name it without >',
    ),
    "alias.yaml": ("a: &x 1\nb: *x\n", ":2: an alias (*); write the value itself"),
    "cut.yaml": ("levels: [", ":1: not usable YAML: "),
    "none.yaml": ("levels: {}\n", ":1: levels: no levels; give a .building.yaml of the traffic editor"),
    "lane.yaml": (
        "levels:\n  L1:\n    vertices:\n      - [1, 2, 0, a]\n    lanes:\n      - [0, 9, {}]\n",
        ":6: levels.L1.lanes: not a lane; write two different vertices from 0 to 0",
    ),
    "notes.txt": ("hello", ': .txt" '),
}


@pytest.mark.parametrize("name", sorted(MISTAKES))
def test_a_mistake_in_a_file_gets_a_line_and_leaves_no_site(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text, wanted = MISTAKES[name]
    (tmp_path / name).write_text(text)
    assert main(["import", str(tmp_path / name), "-o", str(tmp_path / "site.toml")]) == 2
    lines = capsys.readouterr().err.splitlines()
    if name != "notes.txt":
        assert any(line.startswith(f"{tmp_path / name}{wanted}") for line in lines), lines
    assert all(line.startswith(str(tmp_path / name)) and "; " in line for line in lines), lines
    assert sorted(one.name for one in tmp_path.iterdir()) == [name]


def test_more_robots_than_can_start_on_the_bus_are_refused_with_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    wide, output = tmp_path / "wide.map", tmp_path / "site.toml"
    wide.write_text("\n".join(mark * 160 for mark in "r.e"))
    assert main(["import", str(wide), "-o", str(output)]) == 2
    assert capsys.readouterr().err.splitlines() == [
        f"{wide}: robots = 160: 161 machines with the desk, whose start fills a bus of 500000 bit/s; "
        "import at most 150 of them (--robots)"
    ]
    assert not output.exists()
    assert len(imported(tmp_path, wide, "--robots", "150").homes) == 150


def test_a_mistake_leaves_a_site_file_of_before_as_it_was(tmp_path: Path) -> None:
    (tmp_path / "bad.map").write_text("...\n..\n")
    (tmp_path / "site.toml").write_text("mine")
    assert main(["import", str(tmp_path / "bad.map"), "-o", str(tmp_path / "site.toml")]) == 2
    assert (tmp_path / "site.toml").read_text() == "mine"


def test_where_the_site_cannot_be_written_nothing_is_left(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "site.toml").mkdir()
    assert main(["import", str(RANDOM), "-o", str(tmp_path / "site.toml")]) == 2
    assert "site.toml: is a folder; name a file in it" in capsys.readouterr().err
    assert [one.name for one in tmp_path.iterdir()] == ["site.toml"]


def test_a_file_name_that_no_site_may_have_is_made_fit(tmp_path: Path) -> None:
    strange = tmp_path / f"my map (1) {'x' * 40}.map"
    strange.write_text(RANDOM.read_text())
    assert imported(tmp_path, strange).name == f"my_map_1_{'x' * 23}"


@pytest.mark.parametrize(
    ("task", "wanted"),
    [
        ("0 1 2 0\n", ':1: task = "0 1 2 0": not a task; write release, pick-up, delivery'),
        ("0 1 2 0 0\n5 9 1 0 0\n", ":2: endpoint = 9: the map has 3 endpoints; write numbers from 0 to 2"),
        ("200000 1 2 0 0\n", ":1: release = 200000: too late; write a step from 0 to 100000"),
    ],
)
def test_a_mistake_in_a_task_file_names_its_line(
    task: str, wanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a.map").write_text("eee\n...\n.r.\n")
    (tmp_path / "a.task").write_text(task)
    output = tmp_path / "site.toml"
    assert main(["import", str(tmp_path / "a.map"), str(tmp_path / "a.task"), "-o", str(output)]) == 2
    assert capsys.readouterr().err.startswith(f"{tmp_path / 'a.task'}{wanted}")
    assert not output.exists()


SITE = """
[site]
name = "s"
system = "mapd"
[map]
rows = ["e.e", ".@.", "r.e"]
[[desks]]
name = "Desk"
node = 1
[[robots]]
name = "R1"
node = 11
home = "2,0"
[demand]
endpoints = ["0,0", "0,2", "2,2"]
tasks = [[0, "0,0", "2,2"]]
"""
MACHINE = """
[machine]
name = "R1"
site = "s.toml"
[fleet_bus]
interface = "socketcan"
channel = "can0"
"""
SITE_MISTAKES = {
    ('home = "2,0"', 'home = "1,1"'): 'robots[0].home = "1,1": no free cell of the floor',
    ('["e.e",', "[3,"): "map.rows[0] = 3: not a row; write a text of cells",
    ('"r.e"]', '"r.e."]'): 'map.rows[2] = "r.e.": 4 cells; write 3',
    ('"0,0", "2,2"]]', '"0,0", "1,0"]]'): "not between endpoints",
    ("[[0,", "[[-1,"): "not a task; write [release step from 0",
    ('rows = ["e.e", ".@.", "r.e"]', 'rows = ["e@e", ".@.", "r@e"]'): "no way from and to",
    ('"0,2", "2,2"]', '"0,2", "0,2"]'): "named twice",
    ('"0,2", "2,2"]', '{}, "2,2"]'): "demand.endpoints[1] = {}: no free cell",
    ("node = 11", "node = 1"): "node-ID of Desk already",
    ("[[robots]]", '[[desks]]\nname = "D2"\nnode = 2\n\n[[robots]]'): "more than one desk",
    ("[map]", "[hall]"): "neither or both of [map] and [network]",
}


@pytest.mark.parametrize("change", sorted(SITE_MISTAKES))
def test_a_mistake_in_a_site_file_gets_a_line(
    change: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    old, new = change
    assert SITE.count(old) == 1
    path = tmp_path / "s.toml"
    path.write_text(SITE)
    assert main(["run", str(path)]) == 0
    path.write_text(SITE.replace(old, new))
    capsys.readouterr()
    assert main(["run", str(path)]) == 2
    assert SITE_MISTAKES[change] in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "wanted"),
    [
        (
            ["run", "SITE", "--fault", "linger:car=1,for_s=3"],
            "s: a floor of pick-up and delivery has nothing that this strikes (a car does not leave for long)",
        ),
        (["compare", "SITE"], "a floor of pick-up and delivery, and only car parks are compared; name a car park"),
    ],
)
def test_what_such_a_site_cannot_do_is_said_in_one_line(
    arguments: list[str], wanted: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "s.toml"
    path.write_text(SITE)
    assert main([str(path) if word == "SITE" else word for word in arguments]) == 2
    said = capsys.readouterr().err
    assert wanted in said
    assert said.count("\n") == 1


def test_a_machine_without_a_behaviour_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(registry._ADDED, "mapd", System("mapd", {}))
    (tmp_path / "s.toml").write_text(SITE)
    machine = tmp_path / "machine.toml"
    machine.write_text(MACHINE)
    assert onboard_main(["--machine", str(machine)]) == 2
    assert "R1: a VEHICLE of a floor of pick-up and delivery has no controller yet" in capsys.readouterr().err


@pytest.mark.parametrize("word", ["x", "0", "1.5", "-3", "999999"])
def test_a_count_that_is_none_is_told_so_in_words(
    word: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["import", str(HOTEL), "-o", str(tmp_path / "s.toml"), f"--every={word}"])
    assert f"argument --every: {word}: write a whole number from 1 to 10000" in capsys.readouterr().err
