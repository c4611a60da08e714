"""A car park drawn by chance: floors, alleys that branch or close, lifts, compartments, robots, and ways of working."""

import random

from bench._drawn_tables import Tables


class DrawnCarPark:
    """One drawing of a car park: its tables in the order of the file, made from ``draw`` alone."""

    def __init__(self, name: str, draw: random.Random) -> None:
        self.name, self.draw = name, draw
        self.floors = draw.choice((1, 2, 2, 3, 3, 4, 6, 8))
        self.positions = draw.randint(6, 24)
        self.branch = draw.randint(3, 10) if draw.random() < 0.5 else 0
        #: A branch that comes back to the alley: a loop, which may be driven one way round.
        self.is_loop = self.branch > 1 and draw.random() < 0.6
        self.one_way = draw.choice(("both", "rising", "falling")) if self.is_loop else "both"
        #: By the name, so that a building that is drawn again has as many: few drawings have room for several.
        self.robots = random.Random(name).choice((1, 2, 2, 2, 3, 3, 4, 5))
        self._numbers = iter(range(1, 200))

    def tables(self) -> Tables:
        """Everything, in the order of the file."""
        return [
            *self._site(),
            *self._alleys(),
            *self._lifts(),
            *self._spurs(),
            *self._compartments(),
            *self._robots(),
            *self._machines(),
            *self._ways_of_working(),
        ]

    def _index(self) -> int:
        return self.draw.randint(1, self.positions)

    def _place(self) -> str:
        """A position on any alley of any floor, or of the street's."""
        floor = 1 if self.draw.random() < 0.8 else self.draw.randint(1, self.floors)
        if self.branch and self.draw.random() < 0.3:
            return f"p({floor},B,{self.draw.randint(1, self.branch)})"
        return f"p({floor},{self._index()})"

    def _site(self) -> Tables:
        draw = self.draw
        site: dict[str, object] = {"name": self.name, "bitrate": draw.choice((125_000, 250_000, 500_000, 500_000))}
        if draw.random() < 0.15:
            site["seals"] = draw.choice(("watch", "required"))
        floors: dict[str, object] = {"count": self.floors, "positions": self.positions}
        floors["sides"] = draw.choice((["near", "far"], ["near", "far"], ["near"], ["far"]))
        if draw.random() < 0.3:
            floors["without"] = [f"p(*,{self._index()}){draw.choice('NF')}" for _ in range(draw.randint(1, 3))]
        if draw.random() < 0.2:
            floors["pitch_mm"] = draw.choice((2_300, 2_600, 3_000))
        tables: Tables = [("[site]", site), ("[floors]", floors)]
        if self.floors > 1 and draw.random() < 0.2:
            tables.append((f"[floors.{self.floors}]", {"sides": ["near"], "height_mm": draw.choice((2_200, 4_000))}))
        return tables

    def _alleys(self) -> Tables:
        if not self.branch:
            return []
        draw, mouth = self.draw, self._index()
        alley: dict[str, object] = {"name": "B", "from": f"p(*,{mouth})", "positions": self.branch}
        alley["side"] = draw.choice(("near", "far"))
        if not self.is_loop:
            return [("[[alleys]]", alley)]
        # Out, along, and back: the three sides of a rectangle on the alley.
        along = draw.randint(3, 8)
        turn = "near" if mouth + along <= self.positions else "far"
        out: dict[str, object] = {**alley, "side": "far", "one_way": self.one_way}
        long: dict[str, object] = {"name": "C", "from": f"p(*,B,{self.branch})", "positions": along, "side": turn}
        back: dict[str, object] = {"name": "D", "from": f"p(*,C,{along})", "positions": self.branch - 1, "side": turn}
        back["to"] = f"p(*,{mouth + along if turn == 'near' else mouth - along})"
        long["one_way"] = back["one_way"] = self.one_way
        return [("[[alleys]]", one) for one in (out, long, back)]

    def _lifts(self) -> Tables:
        draw = self.draw
        tables: Tables = []
        ends = ["left", "right"]
        draw.shuffle(ends)
        for number in range(draw.randint(1, 3) if self.floors > 1 else draw.choice((0, 0, 1))):
            lift: dict[str, object] = {"name": f"ER{number + 1}", "node": 100 + number}
            chance = draw.random()
            if chance < 0.6 and ends:
                lift["end"] = ends.pop()
            elif chance < 0.8 and self.branch and not self.is_loop:
                lift["doors"] = [f"p(*,B,{self.branch})"]
            else:
                lift["doors"] = [f"p(*,{self._index()}){draw.choice('NF')}"]
            if self.floors > 3 and number and draw.random() < 0.3:
                lift["floors"] = list(range(1, draw.randint(3, self.floors)))
            tables.append(("[[lifts]]", lift))
        return tables

    def _spurs(self) -> Tables:
        draw = self.draw
        return [
            (
                "[[spurs]]",
                {
                    "at": draw.choice((f"p(1,{self._index()})", f"p(*,{self._index()})")),
                    "side": draw.choice(("near", "far")),
                    "length": draw.choice((1, 1, 1, 2, 3)),
                },
            )
            for _ in range(draw.choice((0, 1, 1, 2)))
        ]

    def _compartments(self) -> Tables:
        draw = self.draw
        count = draw.randint(1, 4)
        one_each = count > 1 and draw.random() < 0.25
        uses = ["entry", "exit", *["both"] * (count - 2)] if one_each else ["both"] * count
        return [
            (
                "[[compartments]]",
                {
                    "name": f"IOC{next(self._numbers)}",
                    "node": number,
                    "at": self._place(),
                    "side": draw.choice(("near", "near", "far")),
                    "use": use,
                },
            )
            for number, use in enumerate(uses, start=1)
        ]

    def _robots(self) -> Tables:
        """Most of them on floors and spurs of their own, where they may rest for ever."""
        draw = self.draw
        tracks = [f"p({floor},{self._index()})" for floor in range(2, self.floors + 1)]
        tracks += [f"p({track},1)" for track in range(192, 196)]
        draw.shuffle(tracks)
        homes = [*tracks, *(self._place() for _ in range(self.robots))]
        return [
            ("[[robots]]", {"name": f"MR{number}", "node": 10 + number, "home": home})
            for number, home in enumerate(homes[: self.robots], start=1)
        ]

    def _machines(self) -> Tables:
        draw = self.draw
        tables: Tables = []
        if draw.random() < 0.3:
            tables.append(("[carrier]", {"speed_mm_s": draw.choice((1_000, 2_000, 3_000)), "turn_ms": 5_000}))
        if draw.random() < 0.2:
            tables.append(("[lift]", {"speed_mm_s": draw.choice((500, 2_000))}))
        if draw.random() < 0.2 and self.robots > 1:
            # Nobody serves while a lone robot charges.
            tables.append(("[battery]", {"capacity_wh": draw.choice((480, 800)), "charge_w": 1_200}))
        if draw.random() < 0.2:
            tables.append(("[timing]", {"call_window_ms": draw.choice((1_500, 2_500)), "heartbeat_ms": 1_500}))
        return tables

    def _ways_of_working(self) -> Tables:
        draw = self.draw
        return [
            (
                "[negotiation]",
                {
                    "desk": draw.choice(("any", "nearest", "own")),
                    "place": draw.choice(("nearest", "nearest", "cost", "stay", "balanced", "random")),
                    "rest_at": draw.choice(("nearest", "demand")),
                    "call_at": draw.choice(("arrival", "arrival", "arrival", "key")),
                    "rides": draw.choice(("planned", "planned", "planned", "before")),
                    "offers": draw.choice(("kept", "kept", "told")),
                    "promises": draw.random() < 0.3,
                    "quiet_moves": draw.random() < 0.3,
                },
            )
        ]
