"""A section of the report: static markup, plots over time, and the plots that could not be drawn."""

from __future__ import annotations

from dataclasses import dataclass, field

from markupsafe import Markup, escape

from hil.report.drawing.charts import TimePlot
from hil.report.recorded.flight import Recorded


@dataclass
class Section:
    """One section of one flight. `parts` are drawn in order: markup as it stands, plots on the linked axis."""

    ident: str
    title: str
    parts: list[Markup | TimePlot] = field(default_factory=list)
    lost: list[tuple[str, str]] = field(default_factory=list)  # plot, why it could not be drawn

    def __bool__(self) -> bool:
        """False if there is nothing to show: no flight of the page has what it is about."""
        return bool(self.parts or self.lost)

    def html(self, markup: Markup) -> None:
        self.parts.append(markup)

    def text(self, words: str) -> None:
        self.parts.append(Markup("<p>{}</p>").format(words))

    def plot(self, plot: TimePlot) -> None:
        """Add a plot, or name it as lost if nothing in it can be drawn."""
        if plot.drawable:
            self.parts.append(plot)
        else:
            self.lost.append((plot.title, "no usable sample"))

    def needs(self, recorded: Recorded, title: str, *topics: str) -> bool:
        """True if the recording has all `topics`; if not, the plot called `title` is noted as lost."""
        missing = [t for t in topics if not recorded.has(t)]
        if missing:
            self.lost.append((title, f"no messages on {', '.join(missing)}"))
        return not missing

    def needs_pose(self, recorded: Recorded, title: str, *, vehicle: bool = True, board: bool = True) -> bool:
        """True if it is known where the vehicle and the board were (truth or motion capture)."""
        why = []
        if vehicle and recorded.vehicle is None:
            why.append("no messages on truth/vehicle, mocap/vehicle or vehicle/odometry")
        if board and recorded.board is None:
            why.append("no messages on truth/board or mocap/board")
        if why:
            self.lost.append((title, "; ".join(why)))
        return not why


def table(head: tuple[str, ...], rows: list[tuple[object, ...]], css: str = "") -> Markup:
    """An HTML table; every cell is escaped, Markup stays as it is. Columns after the first are right-aligned by CSS.

    One of four columns or more becomes a list of rows on a phone, each cell beside its column's name.
    """
    wide = len(head) >= 4 and css != "row"
    open_cells = [Markup('<td data-h="{}">').format(name) if wide else Markup("<td>") for name in head]
    cells = Markup("").join(Markup("<th>{}</th>").format(name) for name in head)
    body = Markup("").join(
        Markup("<tr>{}</tr>").format(
            Markup("").join(tag + _cell(c) + Markup("</td>") for tag, c in zip(open_cells, row, strict=True))
        )
        for row in rows
    )
    start = Markup("<thead><tr>{}</tr></thead>").format(cells) if any(head) else Markup("")
    css = f"{css} wide" if wide else css
    return Markup('<div class="scroll"><table class="{}">{}<tbody>{}</tbody></table></div>').format(css, start, body)


def _cell(value: object) -> Markup:
    return value if isinstance(value, Markup) else escape(str(value))
