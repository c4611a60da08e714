"""Which mutations the gate plays: of those that were found as they are, a minute's worth, by the commit's hash."""

from tests.mutate import GATE_S, Played, chosen, found
from tests.project.rows import Mutation, Row

MADE = [
    Played(
        Row(f"P{number:02}", "", f"tests/x.py::test_p{number:02}_x", None, None), "drawn", Mutation("a.py", "3", "4")
    )
    for number in range(60)
]
STORED = {one.name: f"{one.digest} 7.5 {one.row.test}" for one in MADE[:40]}


def test_a_minutes_worth_of_what_was_found() -> None:
    played = chosen(MADE, STORED, "c0ffee")
    assert len(played) == len(set(played)) == GATE_S / 7.5
    assert set(played) <= set(MADE[:40])


def test_the_commit_chooses() -> None:
    assert chosen(MADE, STORED, "c0ffee") == chosen(MADE, STORED, "c0ffee") != chosen(MADE, STORED, "decade")


def test_another_mutation_under_the_same_name_was_not_found() -> None:
    assert found(MADE, STORED) == MADE[:40]
    assert found([one._replace(mutation=Mutation("a.py", "3", "5")) for one in MADE], STORED) == []
