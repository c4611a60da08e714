"""Live controllers under random and mutated frames.

``python -m bench.fuzz [FRAMES] [SEED] [SITE ...]``: a million frames for one machine of each kind on the small site, or
on those named (shipped ones, or site files of any system). Each line: frames, program errors (must be 0), drops that no
reason counted (must be 0), size of all tables over time, frames a second.
"""

import sys
import time

from bench._arguments import a_count, a_site, given
from bus_sim.campaign.fuzz import Fuzzer, record
from bus_sim.sites import find_site
from onboard.contract.codes import KindCode
from onboard.core.site import Machine, Site


def one_of_each_kind(site: Site) -> list[Machine]:
    """The machine of each kind with the lowest node-ID, in the order of node-IDs."""
    found: dict[KindCode, Machine] = {}
    for _, machine in sorted(site.machines.items()):
        found.setdefault(machine.kind, machine)
    return list(found.values())


def main() -> int:
    words = given(frames=(a_count, 1_000_000), seed=(a_count, 1), sites=(a_site, "small"), rest="sites")
    frames, seed, failed = words.frames, words.seed, False
    sites = [find_site(name) for name in words.sites]
    said = {site.name: record(site, seed) for site in sites}
    for site, machine in [(one, machine) for one in sites for machine in one_of_each_kind(one)]:
        fuzzer, began_s = Fuzzer(site, machine, seed, corpus=said[site.name]), time.process_time()
        outcome = fuzzer.run(frames, looks=10)
        name = f"{site.name} {machine.name}"
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
