"""What of a car park's records outlives compaction; who reads each is named beside it."""

from onboard.core.codes import Operation
from onboard.systems.car_park.program import Handling
from onboard.work.compaction import End, Keep, Rules, Which

_CAR = ("car_origin", "car")
_TASK = ("task_origin", "task")

RECORDS: Rules = {
    # recovery.py: a task is in hand from its award until its car is left, or it is another's.
    "award": (Keep("award", _TASK),),
    "sink": (Keep("sink", _TASK),),
    "forfeited": (End(("award", "handled", "sink"), _TASK),),
    # The last handling also ends the shuttle's step; the last car that was left is told to whoever asks.
    "handled": (
        Keep("handled", _TASK),
        Keep("last_handled"),
        End(("award", "handled", "sink"), _TASK, ("handling", (Handling.LEAVE.value,))),
        Keep("left", ("handling",)),
    ),
    "step": (Keep("step"),),
    "riding": (Keep("riding"),),
    "floor": (Keep("floor"), End(("riding",))),
    # bay_memory.py: custody of cars, and the bay's own task. ``retired`` of the core ends what is about a car.
    # In the order in which cars first came.
    "car_at": (Keep("car_at", _CAR, Which.FIRST_AND_NEWEST),),
    "winner": (Keep("winner", _CAR),),
    "ticket": (Keep("ticket", _CAR, Which.ALL),),
    "job": (Keep("job"), End(("ticket",), _CAR, ("operation", (int(Operation.RETRIEVE),)))),
    "job_over": (End(("job",)),),
    # compartment.py
    "number": (Keep("number"),),
    # outputs.py: for people; nobody reads it.
    "door": (Keep("door", ("door",)),),
    # lift.py
    "ride": (Keep("ride"),),
    "ride_over": (End(("ride",)),),
}
