"""Bus load and response times from a log: bit-exact lengths, and never less than what the simulated bus measured."""

import random
from pathlib import Path

import pytest

from bus_sim.can.bitstream import frame_length_bits
from onboard.core.frame import Frame
from onboard.trace.cli import main
from onboard.trace.frame_bits import frame_bits
from onboard.trace.load import bounds_of, loads
from onboard.trace.raw import RawFrame
from onboard.trace.readers.open_log import Log
from onboard.wire.codec import codecs
from tests.trace.runs import SITE, SITE_FILE, run_log


def test_frame_lengths_are_those_of_the_simulated_bus() -> None:
    chance = random.Random(3)
    for _ in range(500):
        extended = chance.random() < 0.6
        can_id = chance.choice([0, chance.randrange(1 << (29 if extended else 11))])
        data = chance.choice([chance.randbytes(8), bytes(chance.randrange(9)), b"\xff" * 8])
        frame = Frame(can_id, data, extended)
        assert frame_bits(frame) == frame_length_bits(frame), frame


def _line(time_us: int, data: bytes) -> RawFrame:
    return RawFrame(time_us, "can0", 0x0C400001, data, is_extended=True)


def test_a_busy_stretch_bounds_the_response_of_its_frames() -> None:
    frame = _line(0, b"\x55" * 8)
    classic = frame.classic()
    assert classic is not None
    length_us = frame_bits(classic) * 2
    # Three frames back to back after a silence, then one alone.
    times = [10_000, 10_000 + length_us, 10_000 + 2 * length_us, 50_000]
    found = loads([frame._replace(time_us=time) for time in times], codecs(), 500_000)["can0"]
    assert found.longest_us == {"ItineraryHead": 3 * length_us}
    assert found.counts == {"ItineraryHead": 4}
    assert found.mean == pytest.approx(4 * length_us / 40_000)


def test_the_load_of_a_run_is_what_the_run_said_and_within_the_bounds(capsys: pytest.CaptureFixture[str]) -> None:
    with Log(str(run_log())) as log:
        fleet = loads(log, codecs(), SITE.bitrate)["fleet"]
    # As the run's own summary says: 0.12 % in the mean, 1.36 % in the worst second, that of power-up.
    assert fleet.mean == pytest.approx(0.00116, abs=0.0001)
    assert fleet.worst_second == pytest.approx(0.01357, abs=0.0002)
    bounds = bounds_of(SITE)
    for name, longest_us in fleet.longest_us.items():
        bound_us = bounds.get(name, (None, None))[0]
        # Messages of people and of the unforeseen have no bound.
        assert longest_us <= (bound_us or 100_000), name
    assert main(["load", str(run_log()), "--site", str(SITE_FILE)]) == 0
    lines = capsys.readouterr().out.splitlines()
    row = next(line.split() for line in lines if line.startswith("Heartbeat"))
    bound_us, priority_us = bounds["Heartbeat"]
    assert bound_us is not None and priority_us is not None
    assert row[2:] == [f"{us / 1000:.2f}" for us in (fleet.longest_us["Heartbeat"], bound_us, priority_us)]


def test_a_stretch_that_is_longer_than_its_bound_is_pointed_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "busy.log"
    step_us = 250
    path.write_text("".join(f"({1 + n * step_us / 1e6:.6f}) fleet 0C400001#5555555555555555\n" for n in range(1_000)))
    assert main(["load", str(path), "--site", str(SITE_FILE)]) == 0
    assert "the bus was busy for longer than the bound" in capsys.readouterr().out


def test_a_bit_rate_that_is_none_is_one_clear_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["load", str(run_log()), "--bitrate", "-5"]) == 2
    assert capsys.readouterr().err == "onboard trace: --bitrate -5: give bit/s above 0, such as 500000\n"
