"""What a person sees of seals in a log: ``check`` judges what counted; dump, page and Wireshark tell what is sealed."""

from pathlib import Path

import pytest

from bus_sim.cli import main as bus_sim
from bus_sim.seals import SimulatedSeals
from onboard.cli import main
from onboard.config.keys import key_text, load_keys
from onboard.config.site import load_site
from onboard.systems.contract import codecs_for
from onboard.trace.readers.open_log import Log
from onboard.web.film import Film
from tests.seal.test_site import site_with
from tests.tools import require_tool, run_tool

Capture = pytest.CaptureFixture[str]
#: What a forger says of node 11 behind a seal of its own, two seconds behind all others.
FORGED = ("0111000B#2010007000000000", "0103000B#0100112233445566")
QUESTION = "1054000B#0000000000000000"


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> tuple[str, str, str]:
    """Site file, log and key file of a run with a forger under R1's number, without seals and once with a false one."""
    folder = tmp_path_factory.mktemp("seals")
    site_file, log, keys = site_with("required", folder), folder / "run.log", folder / "a.keys"
    forger = "attack:name=grant-asked,at_s=20,for_s=20,node=11"
    assert bus_sim(["run", site_file, "--for", "60", "--trace", str(log), "--fault", forger]) in (0, 1)
    last_s = float(log.read_text().splitlines()[-1].split()[0].strip("()"))
    with log.open("a", encoding="utf-8") as file:
        file.writelines(f"({last_s + 2:.6f}) fleet {frame}\n" for frame in FORGED)
        # Whether something follows is known once time has passed.
        file.write(f"({last_s + 3:.6f}) fleet {QUESTION}\n")
    site = load_site(Path(site_file))
    keys.touch(mode=0o600)
    drawn = SimulatedSeals(site, 1, codecs_for(site).fleet.decode_part).keys(11)
    keys.write_text(key_text(drawn, site.name, "R1", "").replace("made = 0", "made = 1"), encoding="utf-8")
    return site_file, str(log), str(keys)


def test_forged_frames_of_a_log_are_told_and_not_judged(seen: tuple[str, str, str], capsys: Capture) -> None:
    site_file, log, keys = seen
    words = ["trace", "check", log, "--site", site_file]
    assert main(words) == 1
    told = capsys.readouterr().out
    assert "seals: R1: " in told and " sealed, " in told and "right" not in told
    assert main([*words, "--keys", keys]) == 0
    told = capsys.readouterr().out
    assert "under R1's number without a seal" in told
    assert "seals: 1 under R1's number with false seals" in told
    assert "seals: R1: " in told and " seal right, 1 seal wrong, " in told
    assert main([*words[:-1], "graph", "--keys", keys]) == 2
    assert "needs --site with the file of a site that has seals" in capsys.readouterr().err


def test_dump_tells_of_each_frame_whether_it_is_sealed(seen: tuple[str, str, str], capsys: Capture) -> None:
    site_file, log, keys = seen
    words = ["trace", "dump", log, "--decode", "--site", site_file]

    def lines(*more: str) -> list[str]:
        assert main([*words, *more]) == 0
        return capsys.readouterr().out.splitlines()

    plain, known = lines(), lines("--keys", keys)
    assert [line.split("  [")[0] for line in plain] == [line.split("  [")[0] for line in known]
    forged = next(at for at in range(len(plain) - 1, 0, -1) if "R1 TokenHeld" in plain[at])
    assert plain[forged].endswith("[sealed]") and known[forged].endswith("[seal wrong]")
    grants = [at for at, line in enumerate(plain) if " TokenGrant: " in line]
    assert {known[at].split("  [")[1] for at in grants} == {"seal right]", "unsealed]"}
    assert all("  R1 " in known[at] for at in grants if known[at].endswith("[unsealed]"))
    beats = {line.split("  [")[1] for line in known if " Heartbeat: " in line}
    assert beats == {"seal right]", "unsealed, nothing new]"}


def test_dump_of_a_log_in_candumps_format_is_left_as_it_is(seen: tuple[str, str, str], capsys: Capture) -> None:
    site_file, log, keys = seen
    assert main(["trace", "dump", log, "-L", "--site", site_file]) == 0
    assert "sealed" not in capsys.readouterr().out
    assert main(["trace", "dump", log, "-L", "--site", site_file, "--keys", keys]) == 2
    assert "leave out -l, -L, --dbc" in capsys.readouterr().err


def test_the_page_counts_by_machine_whose_seals_are_right(seen: tuple[str, str, str]) -> None:
    site_file, log, keys = seen
    for key_file in (None, keys):
        counts = _on_page(site_file, log, key_file)[11]["seals"]
        if key_file is None:
            assert counts["sealed"] > 20 and counts["unsealed"] > 1
        else:
            assert counts["seal right"] > 20 and counts["seal wrong"] == 1 and counts["unsealed"] > 0


def _on_page(site_file: str, log: str, key_file: str | None) -> dict[int, dict[str, dict[str, int]]]:
    site = load_site(Path(site_file))
    keys = None if key_file is None else load_keys(Path(key_file), site)
    with Film(site, codecs_for(site), keys) as film, Log(log) as frames:
        film.read(frames)
        machines: dict[int, dict[str, dict[str, int]]] = film.show(film.last_us).snapshot()["machines"]
        return machines


def test_wireshark_tells_which_frames_are_sealed(seen: tuple[str, str, str], tmp_path: Path, capsys: Capture) -> None:
    require_tool("tshark")
    site_file, log, _ = seen
    capture, script = tmp_path / "run.pcapng", tmp_path / "onboard.lua"
    assert main(["trace", "convert", log, str(capture)]) == 0
    capsys.readouterr()
    assert main(["trace", "dissector", site_file]) == 0
    script.write_text(capsys.readouterr().out, encoding="utf-8")
    assert main(["trace", "dump", log, "--decode", "--site", site_file]) == 0
    ours = [line for line in capsys.readouterr().out.splitlines() if line.endswith("ealed]") and "Heartbeat" in line]
    words = ("-2", "-R", "onboard", "-Y", "onboard.message == Heartbeat", "-T", "fields", "-e", "onboard.sealed")
    told = run_tool("tshark", "-X", f"lua_script:{script}", "-r", str(capture), *words).split()
    assert [one == "1" for one in told] == [line.endswith("[sealed]") for line in ours]
    assert {"0", "1"} == set(told)
