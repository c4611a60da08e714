"""Every interleaving of the shipped token book and witness: ``python -m tests.models.explore --help``."""

import argparse

from tests.models.explorer import Explorer, Limits


def main() -> None:
    """Explore as the command line says."""
    parser = argparse.ArgumentParser(description="Every interleaving of the shipped token book and witness.")
    parser.add_argument("--nodes", type=int, default=3)
    parser.add_argument("--versions", type=int, default=2)
    parser.add_argument("--crashes", type=int, default=1)
    parser.add_argument("--old-copies", type=int, default=0, help="starts from an old copy of a journal")
    parser.add_argument("--ghost", action="store_true", help="a node that the site does not have says what it likes")
    parser.add_argument("--most-s", type=float, default=600.0, help="CPU seconds after which it ends")
    options = parser.parse_args()
    limits = Limits(options.nodes, options.versions, options.crashes, options.old_copies, options.ghost, options.most_s)
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
