"""What of a cell's records outlives compaction: its robots' contracts (memory.py), its desk's orders (counter.py)."""

from onboard.systems.cell.memory import Stage
from onboard.work.compaction import MOST_OVER, End, Keep, Rules, Which
from onboard.work.counter_records import RECORDS as COUNTER_RECORDS

_TASK = ("origin", "number")

RECORDS: Rules = {
    **COUNTER_RECORDS,
    "contract": (Keep("contract", _TASK, Which.FIRST_AND_NEWEST),),
    "contract_lost": (End(("contract", "stage"), _TASK),),
    "stage": (Keep("stage", _TASK), End(("contract", "stage"), _TASK, ("stage", (Stage.OVER.name,)), MOST_OVER)),
}
