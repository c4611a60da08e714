"""What of a counter's records outlives compaction (counter.py reads them); the same for each such desk."""

from onboard.work.compaction import MOST_OVER, End, Keep, Rules
from onboard.work.counter import OVER

_NUMBER = ("number",)

RECORDS: Rules = {
    "order": (Keep("order", _NUMBER),),
    "order_state": (
        Keep("order_state", _NUMBER),
        End(("order", "order_state"), _NUMBER, ("state", tuple(one.name for one in OVER)), MOST_OVER),
    ),
}
