"""A little SVG: shapes and texts, nothing that needs a library.

Colours are those of Okabe and Ito (Color Universal Design, 2008), told apart by colour-blind people; lines differ by
their dashes as well.
"""

from html import escape

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000", "#8C6D1F")
#: These have less than 3:1 on the ground of a panel (WCAG 2.2, 1.4.11): a line of theirs has a dark rim.
PALE, RIM = frozenset({"#CC79A7", "#E69F00", "#56B4E9"}), "#4d4d4d"
DASHES = ("", "6 3", "2 2", "8 3 2 3")


def colour(number: int) -> str:
    """The colour of the n-th machine; they come round."""
    return COLOURS[number % len(COLOURS)]


def dashes(number: int) -> str:
    """The dashes of the n-th machine: they change when colours come round."""
    return DASHES[number // len(COLOURS) % len(DASHES)]


class SvgDrawing:
    """Shapes in pixels, in the order in which they are put in: later ones lie on top."""

    def __init__(self, width: float, height: float, title: str) -> None:
        self.width, self.height = width, height
        self._parts = [
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width:.0f}" height="{height:.0f}" '
            f'viewBox="0 0 {width:.0f} {height:.0f}" font-family="DejaVu Sans, sans-serif" font-size="11">',
            f"<title>{escape(title, quote=False)}</title>",
            '<rect width="100%" height="100%" fill="#ffffff"/>',
        ]

    def line(self, points: list[tuple[float, float]], stroke: str, *, width: float = 1, dash: str = "") -> None:
        """A line through points in px, dashed where a pattern is given."""
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        dashed = f' stroke-dasharray="{dash}"' if dash else ""
        self._parts.append(f'<polyline points="{path}" fill="none" stroke="{stroke}" stroke-width="{width}"{dashed}/>')

    def way(self, points: list[tuple[float, float]], number: int, *, width: float) -> None:
        """The line of the n-th machine through points in px, by its colour and its dashes."""
        if colour(number) in PALE:
            self.line(points, RIM, width=width + 1.6, dash=dashes(number))
        self.line(points, colour(number), width=width, dash=dashes(number))

    def area(self, points: list[tuple[float, float]], fill: str, *, opacity: float, note: str = "") -> None:
        """A filled shape; ``note`` is shown where a browser's pointer rests on it."""
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        title = f"<title>{escape(note, quote=False)}</title>" if note else ""
        self._parts.append(f'<polygon points="{path}" fill="{fill}" fill-opacity="{opacity}">{title}</polygon>')

    def ring(self, x: float, y: float, radius: float, stroke: str, *, width: float = 1) -> None:
        """A circle around x and y, px, that is not filled."""
        self._parts.append(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}" fill="none" stroke="{stroke}" stroke-width="{width}"/>'
        )

    def text(
        self,
        x: float,
        y: float,
        words: str,
        *,
        anchor: str = "start",
        fill: str = "#222222",
        size: float | None = None,
        halo: str | None = None,
        upwards: bool = False,
    ) -> None:
        """Words with their baseline at x and y, px; signs that SVG reserves are escaped.

        ``halo`` is the colour of a rim that parts them from what lies below; ``upwards`` is read from below.
        """
        more = f' font-size="{size:.1f}"' if size is not None else ""
        more += f' stroke="{halo}" stroke-width="3" paint-order="stroke"' if halo is not None else ""
        more += f' transform="rotate(-90 {x:.1f} {y:.1f})"' if upwards else ""
        said = escape(words, quote=False)
        self._parts.append(f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{fill}"{more}>{said}</text>')

    def arrow(self, x1: float, x2: float, y: float, stroke: str) -> None:
        """A level arrow from one lane to another."""
        tip = 5 if x2 < x1 else -5
        self.line([(x1, y), (x2, y)], stroke, width=1.2)
        self.area([(x2, y), (x2 + tip, y - 3), (x2 + tip, y + 3)], stroke, opacity=1)

    def __str__(self) -> str:
        return "\n".join([*self._parts, "</svg>", ""])
