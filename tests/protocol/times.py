"""The times of docs/protocol.md, from the constants of the code; a site's own from its file's defaults."""

from typing import NamedTuple

from bus_sim.sites import find_site
from onboard.core import authority, backoff, bus_time, mirror, site
from onboard.core.negotiation import bidding, initiator, negotiation, participant, sub_calls, trust, winners
from onboard.holon import fixed_times, holding, presence, regeneration, rights, witness
from onboard.systems.car_park import (
    bay_calls,
    bay_task,
    desk_calls,
    least_bids,
    promises,
    sill,
    stall,
    starting,
    stewardship,
    travel,
)
from onboard.ways import all_or_none, left_behind, passing_order, retreats, standing, told_way
from onboard.wire import decoder

SITE = find_site("small")
_TIMING = SITE.timing
_REPEAT_US = _TIMING.token_repeat_us
_BACKOFF = backoff.BackOff(_REPEAT_US)
_FIXED = "fixed"


class Time(NamedTuple):
    """One line: its name in the duties, its value in us, where that is from, and what it is."""

    name: str
    us: int
    source: str
    meaning: str


def _of_site(key: str) -> str:
    return f"site: `{key}`"


TIMES: dict[str, tuple[Time, ...]] = {
    "frames": (
        Time("T_set", decoder.SET_TIMEOUT_US, _FIXED, "an incomplete set of frames is dropped after its last frame"),
    ),
    "bus-time": (
        Time("T_time", _TIMING.bus_time_us, _of_site("bus_time_ms"), "from one `BusTime` to the next"),
        Time("T_slew", bus_time.MAX_SLEW_US, _FIXED, "the most that one `BusTime` corrects a clock"),
        Time("T_far", bus_time.FAR_US, _FIXED, "an error beyond this is none of drift"),
        Time("T_same", bus_time.SAME_US, _FIXED, "two errors that differ by no more are the same"),
        Time("T_lost", bus_time.MISSED_LIMIT * _TIMING.bus_time_us, "4 T_time", "a clock that heard none is lost"),
        Time("T_young", bus_time.YOUNG_US, _FIXED, "whoever has sent bus time for less takes up that of others"),
    ),
    "presence": (
        Time("T_beat", _TIMING.heartbeat_us, _of_site("heartbeat_ms"), "heartbeat period"),
        Time("T_apart", site.BEATS_APART_US, _FIXED, "the least between two heartbeats of one machine"),
        Time("T_tell", fixed_times.TELL_US, _FIXED, "from a word that changes digests to the heartbeat after it"),
        Time("T_silent", mirror.MISSED_HEARTBEATS * _TIMING.heartbeat_us, "3 T_beat", "not heard so long: silent"),
        Time("T_slept", presence.SLEPT_BEATS * _TIMING.heartbeat_us, "2 T_beat", "did nothing so long: has slept"),
        Time("T_listen", presence.SETTLING_US, _FIXED, "an obstacle that may take part listens before it does"),
        Time("T_settle", starting.SETTLING_US, _FIXED, "of a restarted robot: from a known place to its plan"),
        Time("T_stands", standing.STANDS_AFTER_US, _FIXED, "stands where its plan has left, and says nothing"),
        Time("T_waits", standing.WAITS_AFTER_US, _FIXED, "the same, and says that it waits"),
        Time("T_stuck", stall.STALL_US, _FIXED, "a drive with orders that does not move is broken"),
    ),
    "calls": (
        Time("T_call", _TIMING.call_window_us, _of_site("call_window_ms"), "from a call to its deadline"),
        Time("W", _TIMING.bid_delay_us, _of_site("bid_delay_ms"), "the longest delay of a bid"),
        Time("h", _TIMING.bid_half_us, _of_site("bid_half_ms"), "cost above the floor at which half of W is waited"),
        Time("T_guard", _TIMING.deadline_guard_us, _of_site("deadline_guard_ms"), "guard before a deadline"),
        Time("T_slot", bidding.slot_length_us(SITE.bitrate), "480 bit times + 0.5 ms", "one speaking slot"),
        Time("T_far_call", negotiation.MAX_WINDOWS * _TIMING.call_window_us, "60 T_call", "no deadline is farther"),
        Time("T_slack", bidding.FLOOR_SLACK_MS * 1000, _FIXED, "a FINISH_TIME below the floor by more is void"),
        Time("T_belief", participant.LAPSE_REPEATS * _TIMING.award_repeat_us, "100 T_award", "a best bid lapses"),
        Time("T_forget", negotiation.FORGET_US, _FIXED, "a closed call is forgotten so long after its deadline"),
    ),
    "awards": (
        Time("T_award", _TIMING.award_repeat_us, _of_site("award_repeat_ms"), "from one award to the next"),
        Time("T_award_slow", initiator.SLOW_DOWN * _TIMING.award_repeat_us, "10 T_award", "behind the tenth of them"),
        Time("T_award_most", initiator.SLOWEST * _TIMING.award_repeat_us, "40 T_award", "it grows no longer"),
        Time("T_hold", sub_calls.HOLD_REPEATS * _TIMING.award_repeat_us, "10 T_award", "an option outlasts its call"),
        Time("T_accept", initiator.ACCEPT_WITHIN_US, _FIXED, "a winner is heard within this of its award"),
        Time("T_away", winners.LOST_AFTER_US, _FIXED, "a winner that is an obstacle for so long is lost"),
        Time("T_idle", winners.STANDS_AFTER_US, _FIXED, "a winner of which nothing changes for so long is lost"),
        Time("T_out", trust.OUT_OF_TASK_US, _FIXED, "out of calls for a task; doubled with each time"),
        Time("T_out_all", trust.OUT_OF_ALL_US, _FIXED, "out of all calls after two; four times as long with each more"),
        Time("T_out_most", trust.MOST_OUT_US, _FIXED, "nobody is out for longer"),
        Time("T_sooner", least_bids.SLACK_MS * 1000, _FIXED, "a robot's bid so far below what it can do is void"),
        Time("T_late", trust.LATE_MS * 1000, _FIXED, "mean lateness beyond twice the others' that counts as a fail"),
    ),
    "plans": (
        Time("T_round", told_way.TOLERANCE_US, _FIXED, "windows that overlap by no more do not meet"),
        Time("T_aged", retreats.AGES_AFTER_MS * 1000, _FIXED, "a way back yields to no stamp younger by more"),
        Time("T_place", stall.PLACE_US, _FIXED, "a place is told at the next border where the last word is older"),
    ),
    "tokens": (
        Time("T_token", _REPEAT_US, _of_site("token_repeat_ms"), "the first three repeats of a request or grant"),
        Time("T_token_most", _BACKOFF.longest_us, "25 T_token", "repeats grow, doubling, to this"),
        Time("T_set_most", _BACKOFF.unordered_us, "10 T_token", "the same, asked for without an agreed order"),
        Time("T_lapse", _BACKOFF.lapses_us(is_ordered=True), "62.5 T_token", "a request not repeated lapses"),
        Time("T_set_lapse", _BACKOFF.lapses_us(is_ordered=False), "25 T_token", "the same, without an agreed order"),
        Time("T_pace", backoff.PACE_US, _FIXED, "one machine repeats about one frame in so long, all together"),
        Time("T_refused", authority.REFUSED_REPEATS * _REPEAT_US, "5 T_token", "refused and asked soon again"),
        Time("T_flight", authority.IN_FLIGHT_US, _FIXED, "a grant so young is not said again"),
        Time("T_view", rights.ASK_AGAIN_US, _FIXED, "whoever sees another order is asked at most so often"),
        Time("T_order", travel.ORDER_PATIENCE_US, _FIXED, "no agreed order for so long: all or none"),
        Time("T_whole", all_or_none.PATIENCE_REPEATS * _REPEAT_US, "10 T_token", "an incomplete set is kept so long"),
        Time("T_cross", passing_order.CROSSED_US, _FIXED, "of two plans told within this neither heard the other"),
        Time("T_left", left_behind.LEFT_US, _FIXED, "what was left behind goes back at the latest"),
    ),
    "lifts": (Time("T_sill", sill.ASK_AGAIN_US, _FIXED, "a lift's word that does not come is asked for"),),
    "custody": (
        Time("T_unheard", stewardship.UNHEARD_AFTER_US, _FIXED, "the right to fetch is taken from a deaf winner"),
        Time("T_forfeit", stewardship.SAY_AGAIN_US, _FIXED, "FORFEITED is said again until it is called anew"),
    ),
    "queue": (
        Time("T_retry", bay_task.RETRY_US, _FIXED, "a task that nobody could do is called for again; doubled"),
        Time("T_retry_most", bay_task.LONGEST_RETRY_US, _FIXED, "it grows no longer"),
        Time("T_ask", bay_calls.ASK_AGAIN_US, _FIXED, "an award is said again to a winner that shows nothing of it"),
        Time(
            "T_shown",
            bay_calls.NOTHING_SHOWN_US,
            _FIXED,
            "a winner that plans no work has lost its task: longer than one without a way keeps it",
        ),
        Time("T_desk", desk_calls.TURN_US, _FIXED, "turn of a desk to call for a car that stands now"),
        Time("T_claim", bay_task.SETTLING_US, _FIXED, "after a restart, time for a winner to say that it is one"),
        Time("T_told", promises.TOLD_US, _FIXED, "from a ticket to the word when its car will be there"),
    ),
    "restart": (
        Time("T_share", witness.ANSWER_PERIOD_US, _FIXED, "who asks so soon after an answer shares the next"),
        Time(
            "T_flood",
            witness.MOST_FLOOD_US,
            _FIXED,
            "nobody waits longer while a hundred words about rights come in T_share",
        ),
        Time("T_again", witness.AGAIN_US, _FIXED, "from one question to who has not answered to the next"),
        Time("T_new", witness.FIRST_SLOT_US, _FIXED, "a newcomer is asked after this and the own slot"),
        Time("T_turn", witness.SLOT_US, _FIXED, "slot of a question, times the number of lower node-IDs"),
        Time("T_wait", witness.WORDS_WAIT_US, _FIXED, "a digest may be heard so long before its word"),
        Time("T_mine", witness.FRAMES_WAIT_US, _FIXED, "a digest that was mine so recently is equal"),
        Time("T_restless", witness.RESTLESS_US, _FIXED, "four words of mine in so long: I ask nobody"),
        Time("T_compare", witness.COMPARING_BEATS * _TIMING.heartbeat_us, "4 T_beat", "all have compared by then"),
    ),
    "halting": (
        Time("T_stop", holding.STOP_LASTS_US, _FIXED, "an emergency stop ends after it was last heard"),
        Time("T_quiet", holding.QUIET_BEATS * _TIMING.heartbeat_us, "3 T_beat", "nobody else sent under my number"),
        Time("T_twin", holding.TWIN_BEATS * _TIMING.heartbeat_us, "600 T_beat", "who still does is a twin"),
        Time("T_deaf", holding.DEAF_BEATS * _TIMING.heartbeat_us, "2 T_beat", "no frame of anybody: I hear nothing"),
    ),
    "regeneration": (
        Time("T_frozen", regeneration.FORGOTTEN_US, _FIXED, "a freeze that is not said again is over"),
        Time(
            "T_missed",
            regeneration.SAY_AGAIN_US,
            _FIXED,
            "a freeze repeated for so long behind the last word: all is said again",
        ),
    ),
}


def drawn(times: tuple[Time, ...]) -> str:
    """The table of one chapter."""
    rows = [f"| `{one.name}` | {_text(one.us)} | {one.source} | {one.meaning} |" for one in times]
    return "\n".join(("| time | value | from | what it is |", "|---|---|---|---|", *rows))


def _text(us: int) -> str:
    for unit, length_us in (("min", 60_000_000), ("s", 1_000_000), ("ms", 1_000)):
        if us >= length_us and us * 100 % length_us == 0 and (unit != "min" or us % length_us == 0):
            return f"{us / length_us:g} {unit}"
    return f"{us} us"
