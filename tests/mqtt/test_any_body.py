"""Whatever is in an order, the gateway takes or refuses it and lives on: bodies changed in places by a fixed seed."""

import copy
import random
from collections.abc import Iterator
from typing import Any

import pytest

from tests.graph.test_named_orders import END_S, action, order, run, topic
from tests.mqtt.logs import VERSIONS

#: What stands in the place of another value, of a name that is not known, or beside the others of a list.
ANYTHING = [
    None,
    0,
    -1,
    1.5,
    1e300,
    10**30,
    True,
    "",
    "A" * 70,
    "é\0",
    "\ud800",
    "a/b",
    "+",
    "#",
    [],
    {},
    [1],
    {"a": 1},
]
NAMES = ["orderId", "orderUpdateId", "actions", "nodes", "edges", "before", "car", "fetch_at", "id", "other"]
BODIES = 110


def places(body: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """The paths of all values but the whole."""
    inner = body.items() if isinstance(body, dict) else enumerate(body) if isinstance(body, list) else ()
    for key, value in inner:
        yield (*path, key)
        yield from places(value, (*path, key))


def changed(body: Any, draw: random.Random) -> Any:
    """The same but for one to three places, and at times with a name that its schema does not know."""
    body = copy.deepcopy(body)
    if draw.random() < 0.3:
        return body | {draw.choice(NAMES): draw.choice(ANYTHING)}
    for _ in range(draw.randint(1, 3)):
        *path, last = draw.choice(list(places(body)) or [("other",)])
        held = body
        for key in path:
            held = held[key]
        change = draw.random()
        if change < 0.6:
            held[last] = draw.choice(ANYTHING)
        elif change < 0.8:
            del held[last]
        elif isinstance(held, dict):
            held[draw.choice(NAMES)] = draw.choice(ANYTHING)
        else:
            held.insert(last, draw.choice(ANYTHING))
        if not body:
            break
    return body


def drawn(version: str, draw: random.Random) -> Iterator[tuple[float, str, Any]]:
    """One a second: orders to two robots under a few names, and instant actions."""
    for number in range(BODIES):
        serial, at_s = draw.choice(["R1", "R2"]), 20.0 + number
        if draw.random() < 0.6:
            nodes = [(draw.randrange(10), draw.choice(["", "pick", "drop"])) for _ in range(2)]
            body = order(f"o{draw.randrange(9)}", *nodes, serial=serial, version=VERSIONS[version])
            yield at_s, topic("order", serial, version), changed(body, draw)
        else:
            kind = draw.choice(["stateRequest", "cancelOrder", "startPause", "stopPause", "factsheetRequest"])
            body = action(kind, f"a{number}", VERSIONS[version])
            yield at_s, topic("instantActions", serial, version), changed(body, draw)


@pytest.mark.parametrize("version", VERSIONS)
def test_the_gateway_lives_on_whatever_it_is_sent(version: str) -> None:
    good = order("good", (0, ""), (8, "drop"), version=VERSIONS[version])
    stop = action("cancelOrder", "stop", VERSIONS[version])
    bodies = [
        *drawn(version, random.Random(f"any body {version}")),
        (END_S - 5, topic("instantActions", "R1", version), stop),
    ]
    _, ordered = run([*bodies, (END_S - 2, topic("order", "R1", version), good)], version=version)
    assert ordered.lives("made", "R1/good"), "it was taken, or refused with a reason"
