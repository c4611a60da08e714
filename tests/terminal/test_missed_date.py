"""Rows M16, M31: a date that is about to be missed makes one plan anew, and no other, on the bus."""

from collections.abc import Sequence

from bus_sim.options import RunOptions
from bus_sim.systems.terminal.playing import play
from bus_sim.systems.terminal.run import TerminalOutcome
from onboard.contract.messages import Message
from onboard.contract.terminal import PlanHead
from tests.cut import shown
from tests.terminal.seeds import short

#: Whose date is missed.
REMADE = 14


def run(to: str, before: str, at_s: int, held: tuple[str, int, int] | None) -> tuple[TerminalOutcome, list[Message]]:
    """Three boxes to ``to``, two more to S4 before a date; a person holds a vehicle from and for so many seconds."""
    text = f'\n[[missions]]\nat_s = 5\nload = 3\ntype = "T1"\nfrom = "A4"\nto = "{to}"\n'
    text += f'\n[[missions]]\nat_s = {at_s}\ndesk = "Quay"\ntranship = ["B13", "B14"]\nto = "S4"\nbefore = "{before}"\n'
    for name, after_s, do in [(held[0], held[1], "hold"), (held[0], held[1] + held[2], "release")] if held else []:
        text += f'\n[[manual]]\nat_s = {after_s}\nvehicle = "{name}"\ndo = "{do}"\n'
    said: list[Message] = []
    outcome = play(
        short(text),
        RunOptions(seed=1, quiet=True),
        limit_us=900_000_000,
        prepare=lambda one: one.observers.append(lambda message, _: said.append(message)),
    )
    return outcome, said


def heads(messages: Sequence[Message]) -> list[tuple[int, int]]:
    """Who told a plan, and its version."""
    return [(one.sender, one.version) for one in messages if isinstance(one, PlanHead)]


def test_m16_m31_m35_a_date_about_to_be_missed_makes_one_plan_anew_and_it_is_kept() -> None:
    usual, before = run("S10", "16:04", 15, None)
    held, said = run("S10", "16:04", 15, ("R1", 87, 29))
    assert (usual.is_good, usual.touched, held.is_good, held.touched) == (True, 0, True, 1)
    assert not any(one.late_us for one in (*usual.deliveries, *held.deliveries))

    def check(messages: Sequence[Message]) -> None:
        """Up to the plan that is made anew all tell what they would have told."""
        told, undisturbed = heads(messages), heads(before)
        assert (REMADE, 3) in told
        until = told[: told.index((REMADE, 3))]
        assert [one for one in until if one not in undisturbed] == []

    shown(check, said, PlanHead)


def test_m31_a_plan_that_was_made_anew_stands_for_a_while() -> None:
    """A held vehicle's date is missed whatever it plans: it plans again and again, and does not come to rest (once)."""
    outcome, _ = run("S1", "16:03", 25, ("R4", 53, 40))
    assert outcome.is_good and not outcome.halted
    assert outcome.touched < 10
