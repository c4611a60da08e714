"""What one machine's negotiation has cost and spared so far."""

from dataclasses import dataclass


@dataclass
class Counters:
    """Counts since the start, over all calls of one machine, in both roles.

    ``calls_of_other_kind`` cost nothing more than this count (row P06). ``searches_saved`` and ``bids_saved`` are calls
    in which a better bid, the deadline or the award came before the search or the bid. ``late_bids_ignored`` counts
    bids of others that came after a call's cut-off, as initiator and as participant (row P05), ``bids_of_no_account``
    those of machines that are left out or in the way, and those that nobody could keep. Of the options that this
    machine was given, ``options_confirmed`` were awarded, ``options_given_up`` were not needed, and
    ``options_expired`` were not decided in time.
    """

    calls_heard: int = 0
    calls_of_other_kind: int = 0
    calls_impossible: int = 0
    calls_too_late: int = 0
    calls_stale: int = 0
    searches: int = 0
    searches_saved: int = 0
    bids_sent: int = 0
    bids_saved: int = 0
    outbid: int = 0
    won: int = 0
    late_bids_ignored: int = 0
    bids_of_no_account: int = 0
    beliefs_without_award: int = 0
    beliefs_lapsed: int = 0
    sub_calls_opened: int = 0
    options_confirmed: int = 0
    options_given_up: int = 0
    options_expired: int = 0
