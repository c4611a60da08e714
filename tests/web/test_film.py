"""A recorded log as the page shows it: any moment is what the frames up to it say, however one came there."""

import asyncio
import json
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest

from bus_sim.sites import find_site
from onboard.cli import main as onboard
from onboard.contract.messages import Heartbeat
from onboard.trace.frame_bits import frame_bits
from onboard.trace.raw import RawFrame
from onboard.trace.readers.open_log import Log
from onboard.web import film as films
from onboard.web.app import CommandError
from onboard.web.film import Film
from onboard.web.live import LogSource
from tests.web.logs import contract, file_of, film_of, frames_of, log_of

SITES = ("small", "terminal", "graph", "cell", "turning", "mapd")


def shown(film: Film, time_us: int) -> dict[str, Any]:
    """As a browser gets it."""
    found: dict[str, Any] = json.loads(json.dumps(film.show(time_us).snapshot()))
    return found


@pytest.mark.parametrize("name", SITES)
def test_a_moment_looks_the_same_however_one_came_there(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(films, "KEY_EVERY", 64)
    with film_of(name) as film, film_of(name) as other:
        span_us = film.last_us - film.first_us
        moments = [film.first_us + span_us * number // 9 for number in range(10)]
        straight = {moment: shown(film, moment) for moment in moments}
        for moment in (moments[7], moments[2], moments[9], moments[0], moments[5], moments[5]):
            assert shown(other, moment) == straight[moment]
        assert len({json.dumps(one["machines"]) for one in straight.values()}) > 4, "something moves"


def test_a_log_of_another_format_shows_the_same(tmp_path: Path) -> None:
    other_log = tmp_path / "run.pcapng"
    assert onboard(["trace", "convert", str(log_of("small")), str(other_log)]) == 0
    with film_of("small") as film, film_of("small", other_log) as other:
        one, two = shown(film, film.last_us), shown(other, other.last_us)
    assert one == two and one["figures"] == {"parked": 1, "fetched": 1, "calls": 2, "bids": 2}


def test_the_load_shown_is_that_of_the_frames_to_the_bit() -> None:
    with film_of("small") as film:
        chart = shown(film, film.last_us)["chart"]
        first_us = film.first_us
    site, bits, ends = find_site("small"), 0, []
    for raw in frames_of("small"):
        frame = raw.classic()
        assert frame is not None
        if raw.channel == "fleet":
            bits += frame_bits(frame)
            ends.append((raw.time_us, bits))
    first_s, load = chart[0][0], chart[0][1]
    told = next(total for time_us, total in ends if time_us / 1e6 >= first_s)
    assert load == round(told / site.bitrate / (first_s - first_us / 1e6), 5) > 0


def test_a_machine_that_says_nothing_any_more_is_silent() -> None:
    site = find_site("small")
    with film_of("small") as film:
        picture = film.show(film.last_us)
        beat_us = site.timing.heartbeat_us
        assert {one["state"] for one in picture.snapshot()["machines"].values()} == {"idle"}
        later_us = film.last_us
        while later_us < film.last_us + 10 * beat_us:
            later_us += beat_us
            for node in site.machines:
                if node != 11:
                    state = picture.view.history.lives.states[node]
                    picture.feed(Heartbeat(node, 1, site.digest, 0, 1, site.machines[node].kind, state), later_us)
        states = {node: one["state"] for node, one in picture.snapshot()["machines"].items()}
    assert states[11] == "silent" and {state for node, state in states.items() if node != 11} == {"idle"}


@pytest.mark.parametrize("name", SITES)
def test_frames_that_somebody_has_garbled_break_no_picture(name: str) -> None:
    """Whatever numbers they hold: of machines, places, steps or tasks that this site does not have."""
    chance, site = Random(f"garbled:{name}"), find_site(str(file_of(name)))

    def garbled() -> Iterator[RawFrame]:
        for number, raw in enumerate(frames_of(name)[:1_500]):
            data = bytes(byte if chance.random() < 0.7 else chance.randrange(256) for byte in raw.data)
            yield raw._replace(data=data if number % 3 else raw.data)

    with Film(site, contract(site)) as film:
        film.read(garbled())
        for number in range(12):
            time_us = film.first_us + (film.last_us - film.first_us) * number // 11
            assert json.loads(json.dumps(film.show(time_us).snapshot()))["now_us"] == time_us
            film.show(time_us).figures()


def test_a_log_of_another_site_is_refused(tmp_path: Path) -> None:
    site = find_site("small")
    (tmp_path / "other.log").write_text("(1.000000) can0 123#0011\n")
    with (
        Film(site, contract(site)) as film,
        Log(str(tmp_path / "other.log")) as log,
        pytest.raises(ValueError, match="no message of the site's fleet bus"),
    ):
        film.read(log)


def test_a_log_takes_its_own_commands_and_no_others() -> None:
    async def play() -> list[str]:
        with film_of("small") as film:
            source = LogSource(film)
            said = [
                await source.command(*order) for order in (("pause", {}), ("speed", {"factor": 20}), ("resume", {}))
            ]
            said.append(await source.command("seek", {"to_us": film.last_us}))
            assert source.snapshot()["now_us"] == film.last_us and source.snapshot()["pace"] == 0
            for name in ("car_in", "break", "drop", "block"):
                with pytest.raises(CommandError, match="a recorded log cannot be changed"):
                    await source.command(name, {})
            return said

    assert asyncio.run(play()) == ["paused", "20 times real time", "goes on", "there"]
