"""A machine's outgoing queue: what is beyond a budget waits, what is urgent passes, and nothing needless is said."""

import random
from dataclasses import replace

import pytest

from bus_sim.campaign.power_up import large_with
from bus_sim.sites import find_site
from bus_sim.systems.car_park.response import measure
from onboard.contract.base import Message, Stamp
from onboard.contract.codes import Grade, KindCode, LegAction, MachineState, Reason, Side, TokenKind
from onboard.contract.messages import (
    Diagnostic,
    EmergencyStop,
    Heartbeat,
    Itinerary,
    Leg,
    Progress,
    TokenGrant,
    TokenRequest,
)  # fmt: skip
from onboard.controller.outgoing import Outgoing
from onboard.core.frame import Frame
from onboard.systems.car_park.traffic import MOST_LEGS
from onboard.wire.codec import fleet_codec
from onboard.wire.decoder import Decoder
from onboard.wire.pace import HELD_US, SHARES, Pace, paces_of

PACES = {"ItineraryHead": Pace(2, 1_000), "ItineraryLeg": Pace(4, 100_000), "TokenRequest": Pace(2, 50_000)}


class Said:
    """A queue and the frames that it let go, with their times."""

    def __init__(self, paces: dict[str, Pace] = PACES) -> None:
        self.now_us = 0
        self.frames: list[tuple[int, Frame]] = []
        self.queue = Outgoing(fleet_codec(), paces, lambda frame: self.frames.append((self.now_us, frame)))

    def say(self, *messages: Message, at_us: int = 0) -> None:
        self.until(at_us)
        self.now_us = at_us
        for message in messages:
            self.queue.say(message, at_us)

    def until(self, at_us: int) -> None:
        while self.queue.next_us is not None and self.queue.next_us <= at_us:
            self.now_us = max(self.now_us, self.queue.next_us)
            self.queue.release(self.now_us)

    def names(self) -> list[str]:
        """Each run of one message once."""
        names = [fleet_codec().name_of(frame) or "?" for _, frame in self.frames]
        return [name for number, name in enumerate(names) if names[number - 1 : number] != [name]]

    def messages(self) -> list[Message]:
        decoder = Decoder(fleet_codec())
        heard = [decoder.feed(frame, time_us) for time_us, frame in self.frames]
        return [message for message in heard if message is not None]


def plan(version: int, legs: int, grade: Grade = Grade.FIRM) -> Itinerary:
    ends = tuple(Leg(LegAction.TRAVEL, 1, 1, 2, Side.NEAR, 2_000 + number) for number in range(legs))
    return Itinerary(11, version, grade, Stamp(1_000, 1, 1), ends)


def request(index: int, version: int) -> TokenRequest:
    return TokenRequest(11, TokenKind.SEGMENT, 256 + index, 1, version, 0)


def beat(digest: int) -> Heartbeat:
    return Heartbeat(11, 255, 7, digest, 1, KindCode.ROBOT, MachineState.WORKING)


def test_what_is_within_its_budget_goes_at_once_in_the_order_in_which_it_was_said() -> None:
    said = Said()
    said.say(plan(1, 4), request(1, 1), beat(1), request(2, 1))
    assert said.names() == ["ItineraryHead", "ItineraryLeg", "TokenRequest", "Heartbeat", "TokenRequest"]
    assert said.queue.next_us is None


def test_legs_beyond_the_budget_follow_at_its_pace_and_make_the_same_itinerary() -> None:
    said = Said()
    said.say(plan(1, 31))
    said.until(10_000_000)
    times = [time_us for time_us, frame in said.frames if fleet_codec().name_of(frame) == "ItineraryLeg"]
    assert times == [0] * 4 + [100_000 * number for number in range(1, 28)]
    assert said.messages() == [plan(1, 31)]


def test_what_is_urgent_passes_and_so_does_a_place_before_the_slot_that_was_left_is_given_back() -> None:
    said = Said()
    said.say(plan(1, 8))
    grant = TokenGrant(11, TokenKind.SEGMENT, 256, 2, 12)
    said.say(request(1, 1), Progress(11, 1, 0, 1, 2, 0, 0), EmergencyStop(11, Reason.OPERATOR), grant)
    assert said.names() == ["ItineraryHead", "ItineraryLeg", "Progress", "EmergencyStop", "TokenGrant"]
    said.until(10_000_000)
    assert said.names()[5:] == ["ItineraryLeg", "TokenRequest"]


def test_a_sign_of_life_tells_the_latest_and_waits_no_longer_than_it_may() -> None:
    said = Said({**PACES, "ItineraryLeg": Pace(4, 900_000)})
    said.say(plan(1, 31))
    said.say(beat(1), at_us=10_000)
    said.say(beat(2), at_us=500_000)
    said.until(5_000_000)
    beats = [(time_us, frame) for time_us, frame in said.frames if fleet_codec().name_of(frame) == "Heartbeat"]
    assert beats == [(10_000 + HELD_US, fleet_codec().encode(beat(2))[0])]


def test_a_sign_of_life_that_has_waited_tells_what_is_believed_when_it_goes_out() -> None:
    """An older digest was nobody's any more: each of 49 machines asked its sender, who asked all of them."""
    said = Said()
    said.queue.renewed = lambda told: replace(told, mirror_digest=99)
    said.say(plan(1, 6), beat(1))
    telling = [said.queue.is_telling]
    said.until(5_000_000)
    telling.append(said.queue.is_telling)
    assert (telling, said.messages()) == ([True, False], [plan(1, 6), beat(99)])
    said.say(beat(2), at_us=6_000_000)
    assert said.messages()[-1] == beat(2), "one that has not waited is as it was made"


def test_a_plan_that_nobody_heard_gives_way_to_the_next_and_one_that_was_begun_is_told_to_its_end() -> None:
    said = Said()
    said.say(plan(1, 8), plan(2, 8), plan(3, 8))
    said.until(10_000_000)
    assert said.messages() == [plan(1, 8), plan(3, 8)]


def test_an_offer_is_told_though_a_plan_follows() -> None:
    said = Said()
    said.say(plan(1, 8), plan(2, 8, Grade.TENTATIVE), plan(3, 8))
    said.until(10_000_000)
    assert said.messages() == [plan(1, 8), plan(2, 8, Grade.TENTATIVE), plan(3, 8)]


def test_requests_that_wait_are_no_more_than_the_rights_of_one_plan() -> None:
    said = Said()
    for time in range(20):
        said.say(*(request(index, 1 + time // 10) for index in range(7)), at_us=time)
    said.until(10_000_000)
    waited = [frame for _, frame in said.frames[2:]]
    assert waited == [fleet_codec().encode(request(index, 2))[0] for index in range(7)]


def test_a_count_that_waits_is_told_as_it_is_then() -> None:
    said = Said({"Diagnostic": Pace(1, 100_000)})
    for count in range(1, 9):
        said.say(Diagnostic(11, Reason.SHORT_FRAME, count), at_us=count)
    said.until(10_000_000)
    assert said.messages() == [Diagnostic(11, Reason.SHORT_FRAME, count) for count in (1, 8)]


@pytest.mark.parametrize("seed", range(20))
def test_whatever_a_program_says_its_frames_keep_to_the_budgets(seed: int) -> None:
    chance, said, now_us = random.Random(seed), Said(), 0
    for number in range(300):
        now_us += chance.choice((0, 0, 0, 7, 20_000, 300_000))
        words = (plan(number % 250 + 1, chance.randrange(32)), request(chance.randrange(9), number % 3), beat(number))
        said.say(chance.choice(words), at_us=now_us)
    for name, pace in PACES.items():
        times = [time_us for time_us, frame in said.frames if fleet_codec().name_of(frame) == name]
        for first, begin_us in enumerate(times):
            for last in range(first, len(times)):
                assert last - first + 1 <= pace.burst + (times[last] - begin_us) // pace.apart_us


def test_all_machines_together_keep_to_a_share_of_the_bus_at_any_bit_rate() -> None:
    for bit_rate in (125_000, 250_000, 500_000):
        site = large_with(26, bit_rate)
        paces = paces_of(site)
        share = sum(SHARES[name].among(site) * 160 * 1e6 / (pace.apart_us * bit_rate) for name, pace in paces.items())
        assert share <= 0.29


def test_the_longest_plan_goes_out_at_once_on_the_largest_site_that_ships() -> None:
    """Told in three seconds, it was taken by all 49 others for something that they had missed: each asked, for ever."""
    assert paces_of(find_site("harbour"))["ItineraryLeg"].burst >= MOST_LEGS


def test_a_fleet_that_may_hardly_say_anything_says_it_later_and_serves_its_cars(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    slow = dict.fromkeys(("ItineraryHead", "ItineraryLeg", "TokenRequest"), Pace(1, 100_000))
    monkeypatch.setattr("onboard.controller.shell.paces_of", lambda _: slow)
    measured = measure(find_site("level1"), 500_000, 5)
    assert measured.meter.tasks >= 2
    assert measured.meter.worst[False, "ItineraryLeg"] > 3 * 100_000, "legs waited"
