"""What one slot or place is in the terminal's picture: a few columns with a name, a car's number or a dot."""

from onboard.trace.view import SiteView

_LOADED = "bold reverse green"
#: From so many columns on a place has walls.
_WALLED = 5


def style(view: SiteView, nodes: list[int]) -> str:
    """Of machines drawn in one place: whether any of them carries a car."""
    return _LOADED if any(node in view.history.loads.aboard for node in nodes) else "bold green"


def text_columns(cell: int) -> int:
    """Columns for a car's name in a place of ``cell`` columns."""
    return cell - 2 if cell >= _WALLED else cell


def boxed(text: str, box: str, cell: int) -> str:
    """Text of one position; a narrow one has no walls, and an empty place is a dash."""
    if cell >= _WALLED:
        return f"{box[0]}{text[-text_columns(cell) :]:^{text_columns(cell)}}{box[1]}"
    return f"{text[-cell:] or '-':^{cell}}"


def named(view: SiteView, node: int, cell: int) -> str:
    """A machine's name in a slot, its last letters where there is little room: by those, names differ."""
    room = min(cell, 4) if cell >= _WALLED else cell
    return f"{view.name(node)[-room:]:^{cell}}"
