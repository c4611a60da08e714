"""Live controllers under random and mutated frames.

``python -m bench.fuzz [FRAMES] [SEED]``: a million frames for one machine of each kind on the small site. Each line:
frames, program errors (must be 0), drops that no reason counted (must be 0), size of all tables over time, frames a
second.
"""

import sys
import time

from bus_sim.campaign.fuzz import Fuzzer
from bus_sim.sites import find_site


def main() -> int:
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    site, failed = find_site("small"), False
    for name in ("IOC1", "ER1", "MR1"):
        began_s = time.process_time()
        outcome = Fuzzer(site, site.machine(name), seed).run(frames, looks=10)
        rate = outcome.frames / (time.process_time() - began_s)
        print(f"{name}: {outcome.frames} frames, {len(outcome.errors)} errors, {len(outcome.uncounted)} not counted")
        print(f"  items {outcome.sizes}, {rate:.0f} frames a second")
        print(f"  halts {dict(outcome.halts)}")
        print(f"  drops { ({reason.name: count for reason, count in sorted(outcome.reasons.items())}) }")
        for line in [*outcome.errors[:5], *outcome.uncounted[:5]]:
            print(f"  {line}")
        failed = failed or bool(outcome.errors or outcome.uncounted)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
