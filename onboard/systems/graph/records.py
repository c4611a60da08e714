"""What of a factory graph's records outlives compaction: errands of robots (errands.py), orders of the desk (desk.py).

Both are taken up in the order in which they first came.
"""

from onboard.systems.graph.desk import Stage
from onboard.work.compaction import MOST_OVER, End, Keep, Rules, Which

_TASK = ("origin", "number")

RECORDS: Rules = {
    "errand": (
        Keep("errand", _TASK, Which.FIRST_AND_NEWEST),
        End(("errand",), _TASK, ("stops", ("",)), MOST_OVER),
    ),
    "errand_lost": (End(("errand",), _TASK),),
    "visit": (
        Keep("visit", _TASK, Which.FIRST_AND_NEWEST),
        End(("visit",), _TASK, ("stage", (Stage.DONE.name, Stage.REFUSED.name)), MOST_OVER),
    ),
}
