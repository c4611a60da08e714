"""The stored small cases: their optima are optima, and who negotiate come near to what can be done unforeseen."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from bus_sim.cli import main
from bus_sim.systems.car_park.compare import stored_cases as module
from bus_sim.systems.car_park.compare.optimum import is_available, least_waiting_ms
from bus_sim.systems.car_park.compare.plans import CasePlanner, Situation
from bus_sim.systems.car_park.compare.resolved import resolved_waiting_ms
from bus_sim.systems.car_park.compare.small_case import Case
from bus_sim.systems.car_park.compare.stored_cases import AIM, GapTable, StoredCase, as_text, stored_cases
from tests.thinned import is_long

CASES = stored_cases()
#: Those that are proven in less than a tenth of a second.
QUICK = [one for one in CASES if len(one.case.homes) == 2]


def first_cars(case: Case, count: int) -> Case:
    return replace(case, visitors=case.visitors[:count])


def test_there_are_twenty_of_each_kind() -> None:
    kinds = [(len(one.case.homes), len(one.case.visitors)) for one in CASES]
    assert (kinds.count((2, 4)), kinds.count((3, 6))) == (20, 20)
    assert all(visitor.departure_ms is not None for one in CASES for visitor in one.case.visitors)


@pytest.mark.parametrize("one", CASES, ids=lambda one: one.name)
def test_a_stored_plan_waits_as_long_as_is_said_and_nobody_waits_less(one: StoredCase) -> None:
    assert one.plan_ms() == one.clairvoyant_ms
    assert one.clairvoyant_ms <= one.resolved_ms == resolved_waiting_ms(one.case)
    assert one.clairvoyant_ms <= min(one.negotiated_ms, one.by_key_ms)


@pytest.mark.parametrize("one", CASES if is_long() else QUICK[::3], ids=lambda one: one.name)
def test_the_stored_optima_are_found_again(one: StoredCase) -> None:
    assert one.solved_anew() == one


def test_the_gap_of_who_negotiate_is_within_the_aim(capsys: pytest.CaptureFixture[str]) -> None:
    """Printed with ``pytest -s``; the file that is stored is the one that these cases make."""
    table = GapTable.of(CASES)
    with capsys.disabled():
        print("", *table.lines(), sep="\n")
    assert table.mean_to_resolved <= AIM
    # Called for with the key it is measured to miss the aim: 1.154.
    assert AIM < table.rows[-1].by_key_to_resolved <= 1.16


@pytest.mark.skipif(not is_available(), reason="OR-Tools is not installed (extra: optimum)")
@pytest.mark.parametrize("one", QUICK[:3], ids=lambda one: one.name)
def test_the_plans_are_as_good_as_those_of_cp_sat(one: StoredCase) -> None:
    case = first_cars(one.case, 2)
    assert CasePlanner(case).best(Situation.of(case))[0] == least_waiting_ms(case)


def test_who_knows_all_that_will_be_has_no_gap() -> None:
    """One car: nothing can be known beforehand but that it comes, and where it is fetched from."""
    case = first_cars(CASES[0].case, 1)
    alone_ms = CasePlanner(case).best(Situation.of(case))[0]
    near_ms = resolved_waiting_ms(case) - alone_ms
    assert 0 <= near_ms <= max(map(max, case.way_ms))


def test_a_file_that_says_another_optimum_is_told(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    told, one = tmp_path / "gaps.json", QUICK[0]
    wrong = replace(one, clairvoyant_ms=one.clairvoyant_ms - 1)
    monkeypatch.setattr("bus_sim.systems.car_park.compare.command.stored_cases", lambda: (wrong,))
    assert main(["compare", "--parts", "stored", "--jobs", "1", "--json", str(told)]) == 1
    assert f"WRONG {one.name}: stored {one.clairvoyant_ms - 1}" in capsys.readouterr().out
    assert json.loads(told.read_text(encoding="utf-8"))["stored"]["rows"][-1]["count"] == 1


def test_the_file_is_what_these_cases_make() -> None:
    kinds: dict[str, list[StoredCase]] = {}
    for one in CASES:
        kinds.setdefault(one.name.split(",")[0], []).append(one)
    path = Path(module.__file__).parents[3] / "data" / module.NAME
    assert path.read_text(encoding="utf-8") == as_text(kinds)
