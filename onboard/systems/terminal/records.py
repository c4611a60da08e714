"""What of a terminal's records outlives compaction: plans and boxes (memory.py), the desk's orders (missions.py)."""

from onboard.work.compaction import End, Keep, Rules, Which

RECORDS: Rules = {
    # A new plan ends the steps of the one before.
    "plan": (Keep("plan"), End(("step",))),
    "step": (Keep("step", which=Which.ALL),),
    "box": (Keep("box", ("box",)),),
    "orders": (Keep("orders"),),
}
