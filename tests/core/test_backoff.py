"""What waits for an answer is said again ever later; a return begins anew."""

from onboard.contract.constants import NOBODY
from onboard.core.authority import Claim, TokenBook, segment_token
from onboard.core.backoff import LONGEST_REPEATS, QUICK, BackOff
from onboard.core.effects import Send
from onboard.core.site import Segment
from tests.sites import one_floor

REPEAT_US = 200_000


def test_repeats_are_quick_at_first_and_bounded_at_last() -> None:
    backoff = BackOff(REPEAT_US)
    times, now_us = [], 0
    for _ in range(20):
        due_us = backoff.say("it", now_us)
        times.append(due_us - now_us)
        now_us = due_us
    assert times[:QUICK] == [REPEAT_US] * QUICK
    assert times == sorted(times)
    assert times[-1] == LONGEST_REPEATS * REPEAT_US
    backoff.begin_anew()
    assert backoff.say("it", now_us) == now_us + REPEAT_US


def test_a_machine_that_waits_says_at_most_a_frame_a_second_in_the_long_run() -> None:
    site = one_floor()
    robot = next(node for node, machine in site.machines.items() if machine.name == "MR1")
    book = TokenBook(site, robot)
    book.claim = lambda _: Claim(7, NOBODY)
    for index in range(2, 7):
        book.want(segment_token(Segment(1, index)), 0)
    said: list[int] = []
    now_us = 0
    while now_us < 120_000_000:
        due_us = book.next_wake()
        assert due_us is not None
        now_us = due_us
        said += [now_us for effect in book.wake(now_us) if isinstance(effect, Send)]
    late = [time_us for time_us in said if time_us > 20_000_000]
    assert 0 < len(late) - 5 <= (late[-1] - late[0]) / 1_000_000, "five come together"
    book.begin_anew(now_us)
    soon_us = book.next_wake()
    assert soon_us is not None
    assert soon_us <= now_us + book.site.timing.token_repeat_us
