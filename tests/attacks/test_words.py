"""What attacks say, without a fleet around them."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from random import Random

from bus_sim.attacks.attack import TICK_US, AttackerNode
from bus_sim.attacks.catalogue import ATTACKS
from bus_sim.attacks.stolen import StolenKeys
from bus_sim.attacks.words import OtherSite
from bus_sim.seals import SimulatedSeals
from bus_sim.sites import find_site
from onboard.contract.codes import (
    CallResult,
    Criterion,
    Grade,
    KindCode,
    LegAction,
    MachineState,
    Operation,
    Reason,
    Side,
    TokenKind,
)
from onboard.contract.messages import (
    NO_REFERENCE,
    Award,
    BusTime,
    CallForProposals,
    CarAt,
    Heartbeat,
    Itinerary,
    Leg,
    Message,
    Progress,
    Reference,
    Stamp,
    TokenGrant,
    TokenHeld,
    TokenRefusal,
    TokenRequest,
)
from onboard.contract.seal import Seal, SealChallenge
from onboard.core.frame import Frame
from tests.seal.nodes import CODEC, Wire, gate_of, keys_of

DOC = Path(__file__).parents[2] / "docs" / "security.md"
LEG = Leg(LegAction.TRAVEL, 1, 1, 2, Side.NEAR, 9)
FLEET = (
    *(Heartbeat(node, 2, 7, 0, 1, KindCode.ROBOT, MachineState.IDLE) for node in (11, 12)),
    *(CarAt(1, Reference(1, number), number, 3, 2_500) for number in (1, 2)),
    *(BusTime(1, 1_000_000), SealChallenge(12, 0, 7), Seal(11, 3, 9)),
    *(TokenRequest(11, TokenKind.SEGMENT, 258, 3, 1, 0), TokenGrant(12, TokenKind.SEGMENT, 258, 4, 11)),
    *(TokenRefusal(11, TokenKind.SEGMENT, 258, 4, 12, Reason.NONE), TokenRequest(12, TokenKind.SEGMENT, 258, 3, 1, 0)),
    CallForProposals(
        1, 1, Reference(1, 1), Operation.PARK, KindCode.ROBOT, Criterion.FINISH_TIME, 1, 1, 99, 1, 2, NO_REFERENCE, 0
    ),
    *(Award(1, 1, 11, Reference(1, 1), 1, CallResult.AWARDED, Reason.NONE), Progress(11, 1, 1, 1, 1, 0, 0)),
    Itinerary(11, 1, Grade.FIRM, Stamp(0, 1, 1), (LEG,)),
)


def test_every_attack_says_what_the_contract_takes() -> None:
    """And all but those in a system's own words say something, once they have heard the words of a fleet."""
    silent = set(ATTACKS) - set(_said_by_all())
    assert silent == {"orders", "answers"}


def test_machines_of_another_site_have_numbers_that_this_one_has_not() -> None:
    """Under a machine's own number a stranger is believed where no seals are required."""
    site = find_site("small")
    taken = set(site.machines)
    for mine in (9, max(taken) - 1, 240, 248, 250, 255):
        said: list[Message] = []
        OtherSite(AttackerNode(site, mine, Random(1), said.append, lambda _: None, lambda: 0)).tick(0)
        senders = [word.sender for word in said]
        assert senders[0] == mine and len(set(senders)) == 6
        assert not taken & set(senders[1:]) and min(senders) > 0 and max(senders[1:]) <= 250


def test_the_page_about_security_has_every_attack_and_its_right_words() -> None:
    rows = [line.split("|") for line in DOC.read_text(encoding="utf-8").splitlines() if line.startswith("| ")]
    told = {row[2].strip(" `"): {word.strip(" `") for word in row[4].split(",")} for row in rows if len(row) == 6}
    assert {name: words for name, words in told.items() if name in ATTACKS} == {
        name: entry.names for name, entry in ATTACKS.items()
    }


def _say(said: list[Frame], word: Message) -> None:
    said += CODEC.encode(word)


def _said_by_all() -> Iterator[str]:
    site = find_site("small")
    for name, entry in ATTACKS.items():
        said: list[Frame] = []
        say = partial(_say, said)
        node = AttackerNode(site, 240, Random(1), say, said.append, said.__len__)
        attack = entry.attack(node)
        for turn in range(10):
            for word in FLEET:
                attack.hear(word, turn * TICK_US)
                for frame in CODEC.encode(word):
                    attack.hear_frame(frame, turn * TICK_US)
            if turn == 5:
                attack.begin(turn * TICK_US)
            attack.tick(turn * TICK_US + 50_000_000 * (turn > 5))
        if said:
            yield name


class _Keys(SimulatedSeals):
    """Those of the three nodes of tests of seals."""

    def __init__(self) -> None:
        """Nothing is drawn."""

    keys = staticmethod(keys_of)


def test_an_insider_seals_as_its_machine_and_as_others_all_but_what_has_a_taker() -> None:
    wire = Wire({node: gate_of(node) for node in (1, 5, 11)})
    thief = StolenKeys(_Keys(), 5, CODEC.decode_part)
    wire.begin()
    for frame in wire.log:
        thief.hear(frame)
    grant, held = TokenGrant(5, TokenKind.SEGMENT, 258, 7, 11), TokenHeld(1, TokenKind.SEGMENT, 259, 7)
    in_anothers_name = TokenGrant(1, TokenKind.SEGMENT, 260, 7, 11)
    for word in (grant, held, in_anothers_name):
        wire.put(thief.sealed(CODEC.encode(word)[0], wire.now_us))
    assert wire.heard[11] == [grant, held]
    # Node 5 itself hears what was said in its name.
    assert grant in wire.heard[5]


def test_a_thief_of_a_node_that_is_not_there_answers_for_it() -> None:
    wire, held = Wire({node: gate_of(node) for node in (1, 11)}), TokenHeld(5, TokenKind.SEGMENT, 259, 7)
    thief = StolenKeys(_Keys(), 5, CODEC.decode_part)
    wire.begin()
    for _ in range(2):
        heard = len(wire.log)
        wire.put(thief.sealed(CODEC.encode(held)[0], wire.now_us))
        for frame in wire.log[heard:]:
            wire.put(thief.answer(frame, wire.now_us))
        wire.wait(500_000)
    assert wire.heard[11] == [held]
