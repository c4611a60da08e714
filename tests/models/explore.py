"""Every interleaving of shipped code: ``python -m tests.models.explore --help``."""

import argparse
from collections.abc import Callable
from pathlib import Path

from tests.models import engine
from tests.models.as_scenario import as_scenario
from tests.models.award import AwardPart
from tests.models.custody import CustodyPart
from tests.models.explorer import Explorer, Limits
from tests.models.gate import GatePart
from tests.models.moving import engine_of
from tests.models.parking import ParkingPart
from tests.models.runs import RunPart
from tests.models.sealed import explore_sealed

#: What is explored by the engine, by name: made from how many machines and calls.
PARTS: dict[str, Callable[[int, int], engine.Part]] = {
    "award": lambda machines, calls: AwardPart(calls, AwardPart.nodes[:machines], tells_life=True),
    "taking": lambda machines, calls: CustodyPart(calls, AwardPart.nodes[:machines], tells_life=True, laden=False),
    "leaving": lambda machines, calls: CustodyPart(calls, AwardPart.nodes[:machines], tells_life=True),
    "parking": lambda machines, calls: ParkingPart(calls, AwardPart.nodes[:machines], tells_life=True),
    "runs": lambda machines, calls: RunPart(2 * calls, nodes=RunPart.nodes[:machines]),
    "boarding": lambda machines, calls: GatePart(GatePart.nodes[:machines]),
    "riding": lambda machines, calls: GatePart(GatePart.nodes[:machines], aboard=True),
}


def main() -> None:
    """Explore as the command line says."""
    parser = argparse.ArgumentParser(description="Every interleaving of shipped code.")
    parser.add_argument("part", nargs="?", default="tokens", choices=["tokens", "sealed", *PARTS])
    parser.add_argument("--crashes", type=int, default=1)
    parser.add_argument("--sleeps", action="store_true", help="parts: or a machine sleeps for a while")
    parser.add_argument("--most-s", type=float, default=600.0, help="CPU seconds after which it ends")
    parser.add_argument("--nodes", type=int, default=3, help="of the book of rights, or of the part")
    parser.add_argument("--versions", type=int, default=2, help="tokens, sealed: the newest that is explored")
    parser.add_argument(
        "--old-copies", type=int, default=0, help="tokens, sealed: starts from an old copy of a journal"
    )
    parser.add_argument("--seals", type=int, default=3, help="sealed: most seals that a node says in one life")
    parser.add_argument("--ghost", action="store_true", help="tokens: a node that the site does not have speaks")
    parser.add_argument("--calls", type=int, default=2, help="most calls in one life; runs: half the versions")
    parser.add_argument("--scenario", type=Path, help="a counterexample is written here, for `bus-sim run --scenario`")
    options = parser.parse_args()
    if options.part == "sealed":
        sizes = (options.nodes, options.versions, options.crashes, options.old_copies)
        explore_sealed(Limits(*sizes, most_s=options.most_s), options.seals)
        return
    if options.part != "tokens":
        limits = engine.Limits(options.crashes, most_s=options.most_s, sleeps=options.sleeps)
        explore_part(PARTS[options.part](options.nodes, options.calls), limits, options.scenario)
        return
    explore_tokens(
        Limits(options.nodes, options.versions, options.crashes, options.old_copies, options.ghost, options.most_s)
    )


def explore_part(part: engine.Part, limits: engine.Limits, file: Path | None) -> None:
    """Explore one part, and tell the shortest way to what is wrong."""
    explorer = engine_of(part, limits)
    found = explorer.run()
    print(
        f"{limits}: {found.states:,} states, {found.transitions:,} transitions, {found.runs:,} runs of shipped code, "
        f"{found.spent_s:.1f} s, {'complete' if found.is_complete else 'not complete'}: {found.why or 'nothing wrong'}"
    )
    state = found.wrong or found.trap
    if state is not None:
        print(explorer.told(state))
        if file is not None:
            file.write_text(as_scenario(explorer, state).to_toml(explorer.told(state)), encoding="utf-8")


def explore_tokens(limits: Limits) -> None:
    """Explore the book of rights and its witness."""
    explorer = Explorer(limits)
    found = explorer.run()
    print(
        f"{limits}: {found.states:,} states, {found.transitions:,} transitions, {found.spent_s:.1f} s, "
        f"{'complete' if found.is_complete else 'not complete'}, for a person {found.held_for_a_person}"
    )
    for what, state in (("two holders", found.two), ("trap", found.trap), ("false alarm", found.alarm)):
        print(f"{what}:", "none" if state is None else f"\n{explorer.told(state)}")


if __name__ == "__main__":
    main()
