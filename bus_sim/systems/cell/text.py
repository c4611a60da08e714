"""The paper's printed answer (Panescu, Miron 2006, Fig. 5; row C21): moves, takes and delivers with each cost."""

from onboard.systems.cell.geometry import Point


def printed(contracts: list[tuple[str, Point, Point, Point, float]], total: float) -> str:
    """The text for robots in the order of carrying: name, where it stands, takes and delivers, and its own cost.

    An empty list: the goal cannot be achieved. Costs have 15 significant digits and a decimal comma, as CLIPS printed.
    """
    if not contracts:
        return "The goal can not be achieved\n"
    lines = ["The goal can be achieved", f"The cost of the goal fulfilment is: {_number(total)}"]
    lines.append(f"The main contractor is: [{contracts[0][0]}]")
    for name, position, start, via, cost in contracts:
        lines += ["", *_moves(name, position, start), f"Robot [{name}] takes the part", *_moves(name, start, via)]
        lines.append(f"Robot [{name}] delivers the part - the cost of the sub-contract is: {_number(cost)}")
    return "\n".join(lines) + "\n"


def _moves(name: str, start: Point, end: Point) -> list[str]:
    return [f"Robot [{name}] moves:", f"from position {_place(start)}", f"to position {_place(end)}"]


def _place(point: Point) -> str:
    return f"{_number(point.x_mm / 1000)} {_number(point.y_mm / 1000)}"


def _number(value: float) -> str:
    return f"{value:.15g}".replace(".", ",")
