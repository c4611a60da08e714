"""A car park of lines drawn by chance: alleys, lifts between them through which one drives, and links between lines."""

import random
from itertools import pairwise

from bench._drawn_tables import Tables

_BITRATES = (250_000, 500_000, 500_000)


def lines(name: str, draw: random.Random) -> Tables:
    """Lines of one to three alleys on each floor, many robots; upstairs only lifts lead into an alley and out of it."""
    floors = draw.randint(2, 4)
    found = [_line(letter, draw) for letter in "ABCD"[: draw.randint(1, 4)]]
    alleys = [alley for line in found for alley in line]
    long = dict(alleys)
    lifts = [lift for line in found for lift in _lifts(line)]
    tables: Tables = [
        ("[site]", {"name": name, "bitrate": draw.choice(_BITRATES)}),
        ("[floors]", {"count": floors, "positions": long["A1"]}),
    ]
    tables += [("[[alleys]]", {"name": alley, "positions": length}) for alley, length in alleys if alley != "A1"]
    tables += [
        (
            "[[alleys]]",
            {
                "name": f"X{number}",
                "floors": [1],
                "positions": 4,
                "pitch_mm": 2_640,
                "from": _at("*", one[0][0], 1),
                "to": _at("*", other[0][0], 1),
                "sides": [],
            },
        )
        for number, (one, other) in enumerate(pairwise(found), start=1)
    ]
    tables += [
        ("[[lifts]]", {"name": f"L{number}", "node": 100 + number, "doors": _doors(one, other, long)})
        for number, (one, other) in enumerate(lifts, start=1)
    ]
    # Neither where a line ends, with its links and lifts, nor two at one position.
    street = [_at(1, alley, index) for alley, length in alleys for index in range(2, length)]
    draw.shuffle(street)
    spurs = draw.randint(1, 4)
    tables += [("[[spurs]]", {"at": at, "side": draw.choice(("near", "far"))}) for at in street[:spurs]]
    bays = street[spurs : spurs + draw.randint(1, 2 * len(found))]
    tables += [
        ("[[compartments]]", {"name": f"C{number}", "node": number, "at": at}) for number, at in enumerate(bays, 1)
    ]
    homes = [_at(floor, alley, draw.randint(1, length)) for floor in range(2, floors + 1) for alley, length in alleys]
    draw.shuffle(homes)
    homes = [*(f"p({192 + number},1)" for number in range(spurs)), *homes]
    # As many by the name, whatever else is drawn: few drawings have room for many.
    robots = random.Random(name).randint(2, 8)
    tables += [
        ("[[robots]]", {"name": f"MR{number}", "node": 200 + number, "home": home})
        for number, home in enumerate(homes[:robots], start=1)
    ]
    tables.append(("[negotiation]", {"desk": draw.choice(("any", "nearest", "own"))}))
    return tables


def _line(letter: str, draw: random.Random) -> list[tuple[str, int]]:
    """Alleys behind one another, and how many positions each has."""
    return [(f"{letter}{number}", draw.randint(5, 12)) for number in range(1, draw.randint(1, 3) + 1)]


def _lifts(line: list[tuple[str, int]]) -> list[tuple[str, str]]:
    """The alleys on both sides of each lift; a single alley has one at its end."""
    return [(one, other) for (one, _), (other, _) in pairwise(line)] or [(line[0][0], "")]


def _doors(one: str, other: str, long: dict[str, int]) -> list[str]:
    """Where one enters a lift: the end of an alley, and the begin of the next one if there is any."""
    doors = [_at("*", one, long[one])]
    return [*doors, _at("*", other, 1)] if other else doors


def _at(floor: int | str, alley: str, index: int) -> str:
    # The first alley of a site has no name.
    return f"p({floor},{index})" if alley == "A1" else f"p({floor},{alley},{index})"
