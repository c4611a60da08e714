"""Under faults drawn by seed every order of every system is carried out, and nobody is wronged."""

import pytest

from tests.conformance.case import Case
from tests.conformance.cases import CASES
from tests.faults.systems import withstands
from tests.thinned import some

SEEDS = [(case, seed) for case in CASES.values() if case.profiles for seed in some(range(16), 3)]


@pytest.mark.parametrize(("case", "seed"), SEEDS, ids=[f"{case.system}-{seed}" for case, seed in SEEDS])
def test_orders_are_carried_out_whatever_strikes(case: Case, seed: int) -> None:
    report = withstands(case.busy(), seed, case.struck_s(seed), case.limit_s, case.profiles)
    assert report.served > 0 and report.waiting == 0
