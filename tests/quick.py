"""``make check``: the tests that a person runs after each change, and the proof that none of them takes long.

A plugin for pytest (``-p tests.quick``): it leaves out what is known to be slow, and fails every test that takes more
than a second of processor time, its fixtures and the programs that it starts counted. Processor time, as a busy machine
is no fault of a test. ``python -m tests.quick`` prints what is to be collected.
"""

import resource
import sys
import time
from collections.abc import Generator
from pathlib import Path

import pytest

from bus_sim.cli import build_parser

#: Of one test, s of processor time: nobody waits for a single one.
LIMIT_S = 1.0
#: Folders and files of tests that need no whole run of a site.
QUICK = (
    *("tests/can", "tests/config", "tests/controller", "tests/core/negotiation", "tests/demand", "tests/io"),
    *("tests/project/test_layers.py", "tests/project/test_make.py", "tests/project/test_rows.py"),
    *("tests/project/test_sources.py", "tests/system/test_mistakes.py", "tests/system/test_p54_picture.py"),
    *("tests/web/test_contrast.py", "tests/wire"),
    *("tests/core/test_admission.py", "tests/core/test_after_a_jump.py", "tests/core/test_authority.py"),
    *("tests/core/test_backoff.py", "tests/core/test_bus_time_far.py", "tests/core/test_holding.py"),
    *("tests/core/test_memory.py", "tests/core/test_petitions.py", "tests/core/test_serial.py"),
    *("tests/ways/test_all_or_none_pace.py", "tests/ways/test_car_words.py", "tests/ways/test_fig7.py"),
    *("tests/ways/test_kinematics.py", "tests/ways/test_lift_uses.py", "tests/ways/test_occupancy.py"),
    *("tests/ways/test_passing_order.py", "tests/ways/test_reach.py", "tests/ways/test_refuges.py"),
    *("tests/ways/test_reservations.py", "tests/ways/test_standing.py", "tests/ways/test_stops.py"),
)
#: Tests there that take longer than half a second, or may on another machine: `make test` runs them.
SLOW = (
    "tests/demand/test_sizes.py::test_each_car_stands_only_where_it_fits",
    "tests/demand/test_sizes.py::test_who_charges_gets_a_place_for_it_and_others_get_one_only_at_last",
    "tests/can/test_arbitration.py::test_what_is_pending_together_goes_by_priority",
    "tests/can/test_node.py::test_a_sender_of_very_many_identifiers_is_counted_right",
    "tests/can/test_repetition.py::test_what_can_be_seen_is_the_same_whether_each_attempt_is_played_or_not",
    "tests/config/test_any_value.py",
    "tests/config/test_garbage.py",
    "tests/config/test_names.py::test_every_command_takes_the_name_of_a_shipped_site",
    "tests/config/test_shipped_sites.py",
    "tests/controller/test_outgoing.py::test_a_fleet_that_may_hardly_say_anything_says_it_later_and_serves_its_cars",
    "tests/core/negotiation/test_agreement.py",
    "tests/core/negotiation/test_contract_net.py",
    "tests/core/negotiation/test_sub_calls.py::test_whatever_is_lost_nothing_is_acted_on_early_nor_held_for_ever",
    "tests/project/test_layers.py::test_no_file_imports_what_its_layer_may_not",
    "tests/project/test_rows.py",
    "tests/project/test_sources.py::test_the_sources_keep_the_rules_of_the_house",
    "tests/system/test_p54_picture.py::test_p54_the_pictures_drawn_from_the_log_are_those_of_the_run",
    "tests/system/test_p54_picture.py::test_p54_the_picture_shows_the_plant_as_it_is",
    "tests/system/test_p54_picture.py::test_p54_what_is_not_on_the_bus_is_not_in_the_picture",
    "tests/wire/test_codec.py::test_any_hundred_thousand_frames_never_raise_and_take_bounded_memory",
    "tests/wire/test_stock_tools.py",
)
_spent_s = pytest.StashKey[float]()


def processor_s() -> float:
    """Of this process and of all that it has started and waited for, s."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave the slow ones out, and load what commands of ``bus-sim`` need: that is no one test's own."""
    build_parser()
    slow = [item for item in items if item.nodeid.startswith(SLOW)]
    config.hook.pytest_deselected(items=slow)
    items[:] = [item for item in items if item not in slow]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    """Start the item's clock: what is before its first step counts."""
    item.stash[_spent_s] = processor_s()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """A test that was too slow fails when its work is done, by its name and what it took."""
    report = yield
    spent_s = processor_s() - item.stash[_spent_s]
    if call.when == "call" and report.passed and spent_s > LIMIT_S:
        report.outcome = "failed"
        report.longrepr = (
            f"{item.nodeid} took {spent_s:.1f} s of processor time, and a test of `make check` at most {LIMIT_S:g} s: "
            "make it faster, or name it in SLOW (tests/quick.py)"
        )
    return report


def main() -> int:
    """Print what is quick; 1 where a name is that of nothing."""
    root = Path(__file__).parents[1]
    gone = [name for name in (*QUICK, *SLOW) if not (root / name.partition("::")[0]).exists()]
    print("\n".join(gone if gone else QUICK), file=sys.stderr if gone else sys.stdout)
    return bool(gone)


if __name__ == "__main__":
    sys.exit(main())
