"""What of a turning shop's records outlives compaction: jobs of its lathes (machine.py), orders of its desk."""

from onboard.work.compaction import MOST_OVER, End, Keep, Rules
from onboard.work.counter_records import RECORDS as COUNTER_RECORDS

_TASK = ("origin", "number")

RECORDS: Rules = {
    **COUNTER_RECORDS,
    "job": (Keep("job", _TASK),),
    "job_stage": (Keep("job_stage", _TASK),),
    "job_lost": (End(("job", "job_stage"), _TASK),),
    # That a job is over is kept as long as MOST_OVER others; the job itself is not.
    "job_over": (
        End(("job", "job_stage"), _TASK),
        Keep("job_over", _TASK),
        End(("job_over",), _TASK, most=MOST_OVER),
    ),
}
