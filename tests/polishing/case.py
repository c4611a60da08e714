"""A system that is a package of its own, for the tests of every system: found by its entry points, as installed."""

from pathlib import Path

from bus_sim.sites import find_site
from onboard.contract.codes import Reason, TaskPhase
from onboard.contract.messages import Reference, TaskReport
from onboard.trace.check.rights import OneHolder
from tests.conformance.case import Case

FILE = Path(__file__).parents[1] / "plugin" / "shop.toml"
PART = Reference(1, 1)

CASE = Case(
    system="polishing",
    site=FILE.read_text(encoding="utf-8"),
    busy=lambda: find_site(str(FILE)),
    struck_s=lambda _: (10.0, 60.0),
    limit_s=600,
    # It keeps no journals and says things once, as docs/new-system.md says.
    profiles=(),
    goes_on=False,
    parties=(1, 21, 22),
    broken={"polished-once": [[TaskReport(node, PART, TaskPhase.DONE, 0, Reason.NONE) for node in (21, 22)]]},
    # It has no right that goes from hand to hand.
    idle=frozenset({OneHolder}),
    words=(["Desk call 257: machine part", "awarded to New"], ["longest part 40.0 s"], ["task Desk/1"]),
)
