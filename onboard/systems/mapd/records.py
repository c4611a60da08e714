"""What of a mapd site's records outlives compaction: a robot's last words (memory.py), a desk's orders (desk.py)."""

from onboard.work.compaction import MOST_OVER, End, Keep, Rules

_TASK = ("task",)

RECORDS: Rules = {
    "path": (Keep("path"),),
    "step": (Keep("step"),),
    "transport": (Keep("transport", _TASK),),
    # A robot's newest counts; a desk knows of the last MOST_OVER that they are over.
    "served": (End(("transport",), _TASK), Keep("served", _TASK), End(("served",), _TASK, most=MOST_OVER)),
    "round": (Keep("round"),),
    "awards": (Keep("awards"),),
}
