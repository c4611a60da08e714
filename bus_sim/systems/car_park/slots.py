"""What one slot or place is in the terminal's picture: a few columns with a name, a car's number, a dot or a star."""

from onboard.contract.codes import LegAction
from onboard.core.site import Segment
from onboard.trace.view import SiteView

_LOADED = "bold reverse green"
#: A slot through which somebody will drive, and how it is written.
AHEAD, AHEAD_STYLE = "*", "green"
#: From so many columns on a place has walls.
_WALLED = 5


def style(view: SiteView, nodes: list[int]) -> str:
    """Of machines drawn in one place: whether any of them carries a car."""
    return _LOADED if any(node in view.history.loads.aboard for node in nodes) else "bold green"


def ahead(view: SiteView) -> set[Segment]:
    """Slots, platforms among them, through which machines will drive by their firm plans, from where each is."""
    found: set[Segment] = set()
    for node in view.history.plans.firm:
        place = view.history.places.by_node.get(node)
        for number, leg in enumerate(view.history.plans.ahead(node)):
            if leg.action is not LegAction.TRAVEL:
                continue
            begin, step = leg.from_index, 1 if leg.to_index >= leg.from_index else -1
            indices = range(leg.from_index, leg.to_index + step, step)
            if (
                number == 0
                and place is not None
                and place.segment.track == leg.track
                and place.segment.index in indices
            ):
                begin = place.segment.index
            found |= {Segment(leg.track, index) for index in range(begin, leg.to_index + step, step)}
    return found


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
