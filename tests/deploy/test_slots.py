"""The slots' state: every way through an update ends in a system that works; a torn state is that of a new image."""

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from deploy.update.health import HEARTBEATS, Health, frame_of
from deploy.update.slots import ATTEMPTS, SLOTS, STATE_BYTES, BoardEvent, Slots, after, from_block, other, to_block
from onboard.contract.codes import KindCode, MachineState
from onboard.contract.messages import Heartbeat
from onboard.core.frame import Frame
from onboard.wire.codec import fleet_codec

GRUB = Path(__file__).parents[2] / "deploy" / "image" / "files" / "grub.cfg"
STATES = st.builds(
    lambda good, trial, tries, version, failed: Slots(good, other(good) if trial else "", tries, version, failed),
    st.sampled_from(SLOTS),
    st.booleans(),
    st.integers(0, ATTEMPTS),
    st.sampled_from(["1", "0.1.2", "999999.999999.999999.999999"]),
    st.just(""),
)


@given(STATES)
def test_a_state_comes_back_as_it_was_written(state: Slots) -> None:
    block = to_block(state)
    assert len(block) == STATE_BYTES == 1024 and block.startswith(b"# GRUB Environment Block\n")
    assert from_block(block) == state


@given(STATES, STATES, st.integers(0, STATE_BYTES))
def test_a_block_torn_anywhere_never_raises_and_names_a_slot(old: Slots, new: Slots, at: int) -> None:
    state = from_block(to_block(new)[:at] + to_block(old)[at:])
    assert state.next_start in SLOTS


def test_a_block_torn_between_sectors_is_the_old_or_the_new() -> None:
    old, new = Slots("a"), Slots("a", "b", ATTEMPTS, "1.2.3")
    assert from_block(to_block(new)[:512] + to_block(old)[512:]) == new


@pytest.mark.parametrize("block", [b"", b"nonsense", bytes(1024), to_block(Slots("b"))[:-1], b"#" * 1024])
def test_what_is_no_state_is_that_of_a_fresh_image(block: bytes) -> None:
    assert from_block(block) == Slots("a")


@pytest.mark.parametrize(
    ("was", "becomes"),
    [("good=b", "good=c"), ("tries=2", "tries=x"), ("tries=2", "tries=9"), ("trial=a", "trial=b"), ("good=b", "#")],
)
def test_a_state_that_makes_no_sense_is_that_of_a_fresh_image(was: str, becomes: str) -> None:
    block = to_block(Slots("b", "a", 2, "1.1"))
    assert from_block(block.replace(was.encode(), becomes.encode()).ljust(1024, b"#")[:1024]) == Slots("a")


def test_a_system_that_never_speaks_is_started_three_times_then_the_old_one() -> None:
    state, seen = after(Slots("a"), BoardEvent.INSTALLED, "1.1"), []
    for _ in range(5):
        seen.append(state.next_start)
        state = after(state, BoardEvent.STARTED)
    assert seen == ["b", "b", "b", "a", "a"]
    assert after(state, BoardEvent.FELL_BACK) == Slots("a", failed="1.1")


@given(st.sampled_from(SLOTS), st.lists(st.sampled_from([BoardEvent.STARTED, BoardEvent.UNHEALTHY]), max_size=8))
def test_without_a_healthy_word_the_good_slot_stays_the_good_one(good: str, events: list[BoardEvent]) -> None:
    state = after(Slots(good), BoardEvent.INSTALLED, "1.1")
    for event in events:
        state = after(state, event)
    assert state.good == good
    assert after(state, BoardEvent.FELL_BACK).next_start == good


def test_what_cannot_happen_raises() -> None:
    with pytest.raises(KeyError):
        after(Slots(), BoardEvent.HEALTHY)


def test_the_boot_loader_counts_as_the_table_does() -> None:
    script = GRUB.read_text()
    steps = dict(re.findall(r'"\$tries" = (\d) \]; then set left=(\d)', script))
    assert {int(now): int(left) for now, left in steps.items()} == {
        tries: after(Slots("a", "b", tries), BoardEvent.STARTED).tries for tries in range(1, ATTEMPTS + 1)
    }
    loaded = re.search(r"^load_env --file /slots\.env (.*)$", script, re.MULTILINE)
    assert loaded is not None
    assert all(f"{name}=".encode() in to_block(Slots()) for name in loaded[1].split())


def heartbeat(boot: int, node: int = 11) -> Frame:
    message = Heartbeat(node, 1, 2, 3, boot, KindCode.ROBOT, MachineState.IDLE)
    return fleet_codec().encode(message)[0]


def test_a_controller_is_healthy_after_so_many_heartbeats_of_one_life() -> None:
    health = Health(11)
    assert [health.feed(heartbeat(1)) for _ in range(HEARTBEATS)] == [False] * (HEARTBEATS - 1) + [True]


def test_a_controller_that_is_started_again_and_again_is_not_healthy() -> None:
    health = Health(11)
    assert not any(health.feed(heartbeat(life)) for life in range(1, 20) for _ in range(HEARTBEATS - 1))


def test_heartbeats_of_others_do_not_count() -> None:
    health = Health(11)
    assert not any(health.feed(heartbeat(1, node=12)) for _ in range(3 * HEARTBEATS))


def test_frames_as_socketcan_tells_them() -> None:
    assert frame_of(bytes.fromhex("0b005092 08000000 0102030405060708")) == Frame(0x1250000B, bytes(range(1, 9)))
    assert frame_of(bytes.fromhex("0b005092 02000000 0102000000000000")) == Frame(0x1250000B, b"\x01\x02")
    for other_kind in ("0b000000", "0b0050d2", "0b0050b2"):
        assert frame_of(bytes.fromhex(f"{other_kind} 08000000 0102030405060708")) is None
