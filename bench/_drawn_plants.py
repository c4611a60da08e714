"""Sites of the other systems drawn by chance: graph, terminal, manufacturing and turning cell, pick-up and delivery."""

import random
from itertools import pairwise

from bench._drawn_tables import Tables

_BITRATES = (125_000, 250_000, 500_000, 500_000)


def _site(name: str, system: str, draw: random.Random) -> tuple[str, dict[str, object]]:
    keys: dict[str, object] = {"name": name, "system": system, "bitrate": draw.choice(_BITRATES)}
    if draw.random() < 0.15:
        keys["seals"] = draw.choice(("watch", "required"))
    return "[site]", keys


def _desks(draw: random.Random, most: int) -> Tables:
    return [("[[desks]]", {"name": f"D{number}", "node": number}) for number in range(1, draw.randint(1, most) + 1)]


def graph(name: str, draw: random.Random) -> Tables:
    """A ring of nodes with chords, where nobody sticks by the rules: a slot in each node for each robot."""
    nodes = draw.randint(4, 14)
    pairs = {(node, (node + 1) % nodes) for node in range(nodes)}
    while len(pairs) < nodes + draw.randint(0, nodes):
        one, other = draw.sample(range(nodes), 2)
        if (one, other) not in pairs and (other, one) not in pairs:
            pairs.add((one, other))
    robots = draw.randint(1, min(6, nodes))
    keys: dict[str, object] = {
        "rules": "edge-and-node",
        "capacity": max(robots, draw.choice((1, 2, 4))),
        "speed_mm_s": draw.choice((500, 1_000, 2_000)),
        "load_ms": draw.choice((0, 2_000, 5_000)),
        "edges": [[one, other, draw.randint(3, 15) * 1_000] for one, other in sorted(pairs)],
    }
    hosts = draw.randint(1, 3)
    spread = list(range(nodes))
    draw.shuffle(spread)
    return [
        _site(name, "graph", draw),
        ("[graph]", keys),
        *(
            ("[[hosts]]", {"name": f"N{host + 1}", "node": 20 + host, "nodes": sorted(spread[host::hosts])})
            for host in range(hosts)
        ),
        *_desks(draw, 2),
        *(
            ("[[robots]]", {"name": f"R{number}", "node": 30 + number, "at": at})
            for number, at in enumerate(draw.sample(range(nodes), robots), start=1)
        ),
    ]


def terminal(name: str, draw: random.Random) -> Tables:
    """Areas in a circle of one-way lanes, some with a way back, some over a crossing, with stacks and stackers."""
    areas = [f"A{number}" for number in range(1, draw.randint(2, 5) + 1)]
    ways = [*pairwise(areas), (areas[-1], areas[0])]
    ways += [(other, one) for one, other in ways if draw.random() < 0.5 and (other, one) not in ways]
    lanes: Tables = []
    leads: dict[str, list[str]] = {area: [] for area in areas}
    crossed: dict[str, list[str]] = {}
    for number, (one, other) in enumerate(ways, start=1):
        lane: dict[str, object] = {"name": f"L{number}", "length_mm": draw.randint(3, 15) * 10_000}
        lane["capacity"] = draw.randint(1, 4)
        leads[one].append(f"L{number}")
        if draw.random() < 0.4:
            crossing = f"C{draw.randint(1, 2)}"
            crossed.setdefault(crossing, [])
            lane["leads_to"] = [crossing]
            if f"X{other}" not in crossed[crossing]:
                crossed[crossing].append(f"X{other}")
        else:
            lane["leads_to"] = [other]
        lanes.append(("[[lanes]]", lane))
    for crossing, exits in crossed.items():
        names = [f"{crossing}{one}" for one in exits]
        lanes += [
            ("[[lanes]]", {"name": way, "length_mm": 40_000, "capacity": 2, "leads_to": [one.removeprefix("X")]})
            for way, one in zip(names, exits, strict=True)
        ]
        lanes.append(("[[crossings]]", {"name": crossing, "duration_ms": 5_000, "leads_to": names}))
    # A stacker that is empty at first: there is always somewhere to go.
    stations: Tables = [("[[stations]]", {"name": "S0", "area": areas[-1], "kind": "stacker", "room": 30})]
    boxes: Tables = []
    for number in range(1, len(areas) + draw.randint(2, 4)):
        kind = draw.choice(("stack", "stack", "stacker"))
        area = areas[(number - 1) % len(areas)]
        stations.append(
            ("[[stations]]", {"name": f"S{number}", "area": area, "kind": kind, "room": draw.randint(6, 20)})
        )
        if draw.random() < 0.6 or number == 1:
            names = [f"B{number}_{one}" for one in range(1, 7 if number == 1 else draw.randint(3, 6))]
            boxes.append(("[[boxes]]", {"station": f"S{number}", "type": draw.choice(("T1", "T2")), "names": names}))
    vehicles: Tables = [
        ("[[vehicles]]", {"name": f"R{number}", "node": 10 + number, "home": draw.choice(areas)})
        for number in range(1, draw.randint(1, 5) + 1)
    ]
    placed: Tables = [
        ("[[areas]]", {"name": area, "duration_ms": draw.choice((6_000, 10_000, 30_000)), "leads_to": leads[area]})
        for area in areas
    ]
    planning: dict[str, object] = {"horizon_s": draw.choice((30, 60)), "patience_s": draw.choice((20, 30))}
    return [
        _site(name, "terminal", draw),
        ("[planning]", planning),
        ("[vehicle]", {"speed_mm_s": draw.choice((3_000, 5_000))}),
        *_desks(draw, 2),
        *vehicles,
        *lanes,
        *placed,
        *stations,
        *boxes,
    ]


def cell(name: str, draw: random.Random) -> Tables:
    """Arms side by side on a floor of rectangles that touch, or reach into each other."""
    columns, rows = draw.randint(1, 3), draw.randint(1, 2)
    wide = [draw.randint(8, 20) * 1_000 for _ in range(columns)]
    high = [draw.randint(8, 20) * 1_000 for _ in range(rows)]
    robots: Tables = []
    for column in range(columns):
        for row in range(rows):
            x_mm, y_mm = sum(wide[:column]), sum(high[:row])
            reach = draw.choice((0, 0, 1_000, 3_000))
            area = [x_mm, y_mm, x_mm + wide[column] + reach, y_mm + high[row] + reach]
            home = [draw.randint(x_mm + 1_000, area[2] - 1_000), draw.randint(y_mm + 1_000, area[3] - 1_000)]
            number = len(robots) + 1
            robots.append(
                (
                    "[[robots]]",
                    {
                        "name": f"R{number}",
                        "node": 10 + number,
                        "area_mm": area,
                        "home_mm": home,
                        "speed_mm_s": draw.choice((500, 1_000)),
                    },
                )
            )
    tables: Tables = [_site(name, "cell", draw), *_desks(draw, 2), *robots]
    if draw.random() < 0.4:
        x_mm, y_mm = draw.randint(2, wide[0] // 1_000 - 3) * 1_000, draw.randint(2, high[0] // 1_000 - 3) * 1_000
        tables.append(("[[obstacles]]", {"name": "MT1", "area_mm": [x_mm, y_mm, x_mm + 2_000, y_mm + 2_000]}))
    return tables


def turning(name: str, draw: random.Random) -> Tables:
    """One to five lathes of any size, two materials, three drawings."""
    tables: Tables = [_site(name, "turning", draw), *_desks(draw, 2)]
    for number in range(1, draw.randint(1, 5) + 1):
        lathe = {
            "name": f"L{number}",
            "node": 10 + number,
            "hourly_eur": draw.randint(40, 90),
            "power_kw": draw.choice((6, 11, 22)),
            "spindle_max_rpm": draw.choice((3_000, 4_000, 6_000)),
            "reach_mm": draw.choice((150, 250, 500)),
            "setup_min": draw.randint(5, 20),
        }
        largest = draw.choice((42, 160, 250))
        tables.append(("[[lathes]]", lathe))
        tables.append(("[[lathes.chucks]]", {"name": "jaws", "min_mm": 5, "max_mm": largest, "grip_mm": 15}))
        tables.append(("[[lathes.tools]]", _tool(1, ["facing", "roughing"], draw, 2, 0.3)))
        tables.append(("[[lathes.tools]]", _tool(2, ["finishing"], draw, 0.8, 0.2)))
    steel = {"number": 1, "name": "C45", "cutting_force_n_mm2": 2100, "eur_kg": 1.6, "density_kg_dm3": 7.85}
    brass = {"number": 2, "name": "brass", "cutting_force_n_mm2": 780, "eur_kg": 6.5, "density_kg_dm3": 8.5}
    tables += [("[[materials]]", dict(steel)), ("[[materials]]", dict(brass))]
    pin: list[object] = [[0, 0], [0, 10], [1, 12], [30, 12]]
    shaft: list[object] = [[0, 0], [0, 16], [2, 20, 2], [25, 20], [28, 26, -3], [28, 30], [43, 40], [60, 40]]
    tables.append(("[[drawings]]", {"number": 1, "name": "pin", "roughness_um": 3.2, "contour_mm": pin}))
    tables.append(("[[drawings]]", {"number": 2, "name": "shaft", "roughness_um": 1.6, "contour_mm": shaft}))
    tables.append(("[[orders]]", {"drawing": 1, "material": 2, "bar_mm": 14, "batch": draw.randint(1, 6)}))
    tables.append(("[[orders]]", {"drawing": 2, "material": 1, "bar_mm": 45, "batch": draw.randint(1, 4)}))
    return tables


def _tool(number: int, works: list[str], draw: random.Random, depth_mm: float, feed_mm: float) -> dict[str, object]:
    return {
        "number": number,
        "works": list(works),
        "speed_m_min": draw.randint(150, 260),
        "depth_mm": depth_mm,
        "feed_mm": feed_mm,
        "nose_mm": draw.choice((0.4, 0.8)),
        "edge_eur": draw.randint(5, 9),
        "life_min": draw.choice((10, 15, 20)),
    }


def mapd(name: str, draw: random.Random) -> Tables:
    """Shelves of any length between aisles, some crossed by gaps, endpoints beside them, homes at the sides."""
    columns, rows = draw.randint(7, 16), 2 * draw.randint(2, 6) + 1
    floor = [["."] * columns for _ in range(rows)]
    shelves = draw.choice((0.6, 0.8, 0.9))
    for row in range(1, rows, 2):
        for column in range(2, columns - 2):
            if draw.random() < shelves:
                floor[row][column] = "@"
    free = [(row, column) for row in range(rows) for column in range(columns) if floor[row][column] == "."]
    inner = [(row, column) for row, column in free if 2 <= column < columns - 2]
    sides = [(row, column) for row, column in free if column in (0, columns - 1)]
    endpoints = draw.sample(inner, min(len(inner), draw.randint(3, 12)))
    homes = draw.sample(sides, min(len(sides), draw.randint(1, 8)))
    return [
        _site(name, "mapd", draw),
        ("[steps]", {"step_ms": draw.choice((500, 1_000, 1_000, 2_000))}),
        ("[map]", {"rows": ["".join(row) for row in floor]}),
        *_desks(draw, 1),
        *(
            ("[[robots]]", {"name": f"R{number}", "node": 10 + number, "home": f"{row},{column}"})
            for number, (row, column) in enumerate(homes, start=1)
        ),
        ("[demand]", {"endpoints": [f"{row},{column}" for row, column in endpoints]}),
    ]
