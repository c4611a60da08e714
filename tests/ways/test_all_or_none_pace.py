"""A set of tokens that cannot be had says ever less: at most a frame a second in the long run (rule 10)."""

from onboard.contract.codes import Reason
from onboard.contract.messages import TokenGrant, TokenHeld, TokenRequest
from onboard.core.authority import TokenBook, segment_token
from onboard.core.effects import Effect, Send
from onboard.core.site import Segment
from onboard.ways.all_or_none import AllOrNone
from tests.sites import one_floor

SITE = one_floor()
STEWARD = 1
ROBOT = next(node for node, machine in SITE.machines.items() if machine.name == "MR1")
SLOTS = tuple(Segment(1, index) for index in range(2, 8))
#: The one that nobody gives.
TAKEN = SLOTS[-1]
STEP_US = 20_000


def stalled(minutes: int, freed_at_us: int | None = None) -> tuple[list[int], int | None]:
    """When the robot spoke in so many minutes of a set of which one slot is another's; and when it had the whole."""
    robot, steward = TokenBook(SITE, ROBOT), TokenBook(SITE, STEWARD)
    whole = AllOrNone(robot)
    whole.begin(SLOTS, 0)
    said: list[int] = []

    def hear(effects: list[Effect], now_us: int) -> None:
        for effect in effects:
            if not isinstance(effect, Send):
                continue
            match effect.message:
                case TokenRequest() as request:
                    said.append(now_us)
                    key = segment_token(TAKEN)
                    is_taken = (request.token_kind, request.token) == key
                    free = not is_taken or (freed_at_us is not None and now_us >= freed_at_us)
                    why = Reason.NONE if free else Reason.TOKEN_NOT_GRANTABLE_YET
                    answer(steward.on_request(request, why, now_us), now_us)
                case TokenGrant() as grant:
                    said.append(now_us)
                    answer(steward.on_grant(grant, now_us), now_us)
                case TokenHeld() as held:
                    said.append(now_us)
                    answer(steward.on_held(held, now_us), now_us)

    def answer(effects: list[Effect], now_us: int) -> None:
        for effect in effects:
            match effect.message if isinstance(effect, Send) else None:
                case TokenGrant() as grant:
                    hear(robot.on_grant(grant, now_us), now_us)
                case TokenHeld() as held:
                    hear(robot.on_held(held, now_us), now_us)

    for now_us in range(0, minutes * 60_000_000, STEP_US):
        hear(robot.wake(now_us), now_us)
        hear(whole.advance((), now_us), now_us)
        if whole.is_complete:
            return said, now_us
    return said, None


def test_a_stalled_set_says_at_most_a_frame_a_second_in_the_long_run() -> None:
    said, whole_us = stalled(3)
    assert whole_us is None
    late = [time_us for time_us in said if time_us >= 60_000_000]
    assert 0 < len(late) <= 120, f"{len(late)} frames in two minutes"


def test_a_stalled_set_is_had_soon_once_it_can_be() -> None:
    freed_us = 100_000_000
    _, whole_us = stalled(3, freed_us)
    assert whole_us is not None
    assert whole_us - freed_us <= 8_000_000, f"after {(whole_us - freed_us) / 1e6} s"
