"""Figures drawn to scale as inline SVG: a plane in metres, and a histogram."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from markupsafe import Markup, escape

_LEFT, _BOTTOM, _TOP, _RIGHT = 40.0, 34.0, 10.0, 12.0


def ticks(low: float, high: float, about: int = 5) -> list[float]:
    """Round numbers in [low, high], about `about` of them."""
    if not high > low:
        return [low]
    raw = (high - low) / about
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= raw * 0.999)
    first = math.ceil(low / step - 1e-9)
    return [round(i * step, 10) + 0.0 for i in range(first, math.floor(high / step + 1e-9) + 1)]


class Plane:
    """A drawing of points (horizontal, vertical), vertical up: metres, or with `equal` False any two quantities."""

    def __init__(
        self, x: tuple[float, float], y: tuple[float, float], *,
        width: float, max_height: float, name: str, equal: bool = True,
    ) -> None:  # fmt: skip
        """Shows at least the ranges `x` and `y` in `width` px; with equal scales the larger need sets them."""
        room = width - _LEFT - _RIGHT
        span_x, span_y = max(x[1] - x[0], 1e-3), max(y[1] - y[0], 1e-3)
        self.scale, self._scale_y = room / span_x, (max_height - _TOP - _BOTTOM) / span_y
        if equal:
            self.scale = self._scale_y = min(self.scale, self._scale_y)
        self.width, self.height, self.name = width, span_y * self._scale_y + _TOP + _BOTTOM, name
        middle = (x[0] + x[1]) / 2
        self.x = (middle - room / self.scale / 2, middle + room / self.scale / 2)
        self.y = y
        self._parts: list[str] = []  # axes
        self._inside: list[str] = []  # drawn within the frame

    def to(self, x: float, y: float) -> tuple[float, float]:
        """Page coordinates of a point."""
        return _LEFT + (x - self.x[0]) * self.scale, _TOP + (self.y[1] - y) * self._scale_y

    def axes(self, x_label: str, y_label: str, *, mirrored: bool = False) -> None:
        """Grid, numbers and labels; `mirrored`: the horizontal axis counts to the left."""
        right, bottom = self.width - _RIGHT, self.height - _BOTTOM
        for value in ticks(*self.x, about=6):
            px, _ = self.to(value, 0.0)
            shown = (-value if mirrored else value) + 0.0
            self._parts.append(f'<path class="grid" d="M{px:.1f} {_TOP}V{bottom:.1f}"/>')
            self._parts.append(
                f'<text class="tick" x="{px:.1f}" y="{bottom + 13:.1f}" text-anchor="middle">{shown:g}</text>'
            )
        for value in ticks(*self.y, about=max(2, int((bottom - _TOP) / 50))):
            _, py = self.to(0.0, value)
            self._parts.append(f'<path class="grid" d="M{_LEFT} {py:.1f}H{right:.1f}"/>')
            self._parts.append(
                f'<text class="tick" x="{_LEFT - 5}" y="{py + 3.5:.1f}" text-anchor="end">{value:g}</text>'
            )
        middle = (_LEFT + right) / 2
        self._parts.append(
            f'<text class="label" x="{middle:.1f}" y="{bottom + 27:.1f}" text-anchor="middle">{escape(x_label)}</text>'
        )
        vertical = (_TOP + bottom) / 2
        self._parts.append(
            f'<text class="label" text-anchor="middle" transform="translate(11 {vertical:.1f}) rotate(-90)">'
            f"{escape(y_label)}</text>"
        )

    def path(
        self, x: Sequence[float] | np.ndarray, y: Sequence[float] | np.ndarray, style: str, *, close: bool = False
    ) -> None:
        """A polyline; points that are not finite break it. `style` is the SVG style."""
        self._inside.append(f'<path style="fill:none;{style}" d="{self._d(x, y)}{"Z" if close else ""}"/>')

    def _d(self, x: Sequence[float] | np.ndarray, y: Sequence[float] | np.ndarray) -> str:
        d, pen = [], "M"
        for px, py in zip(x, y, strict=True):
            if math.isfinite(px) and math.isfinite(py):
                u, v = self.to(float(px), float(py))
                d.append(f"{pen}{u:.1f} {v:.1f}")
                pen = "L"
            else:
                pen = "M"
        return "".join(d)

    def circle(self, x: float, y: float, radius: float, style: str, *, tip: str = "") -> None:
        """`radius` in metres."""
        u, v = self.to(x, y)
        self._shape(f'<circle cx="{u:.1f}" cy="{v:.1f}" r="{radius * self.scale:.1f}" style="{style}"', "circle", tip)

    def dot(self, x: float, y: float, pixels: float, style: str, *, tip: str = "") -> None:
        u, v = self.to(x, y)
        self._shape(f'<circle cx="{u:.1f}" cy="{v:.1f}" r="{pixels}" style="{style}"', "circle", tip)

    def polygon(self, points: Sequence[tuple[float, float]], style: str) -> None:
        text = " ".join("{:.1f},{:.1f}".format(*self.to(*p)) for p in points)
        self._inside.append(f'<polygon points="{text}" style="{style}"/>')

    def note(
        self,
        x: float,
        y: float,
        text: str,
        *,
        dx: float = 6,
        dy: float = -6,
        anchor: str = "start",
        colour: str = "#333",
    ) -> None:
        u, v = self.to(x, y)
        self._inside.append(
            f'<text class="note" x="{u + dx:.1f}" y="{v + dy:.1f}" text-anchor="{anchor}" fill="{colour}">'
            f"{escape(text)}</text>"
        )

    def _shape(self, start: str, tag: str, tip: str) -> None:
        self._inside.append(f"{start}><title>{escape(tip)}</title></{tag}>" if tip else f"{start}/>")

    def svg(self) -> Markup:
        frame = f"{_LEFT} {_TOP} {self.width - _LEFT - _RIGHT:.1f} {self.height - _TOP - _BOTTOM:.1f}"
        x, y, w, h = frame.split()
        # a nested svg clips what leaves the frame, without an id that two figures could share
        inside = f'<svg x="{x}" y="{y}" width="{w}" height="{h}" viewBox="{frame}">{"".join(self._inside)}</svg>'
        return Markup(
            f'<svg class="plane" role="img" aria-label="{escape(self.name)}" style="max-width:{self.width:.0f}px" '
            f'viewBox="0 0 {self.width:.0f} {self.height:.0f}">{"".join(self._parts)}{inside}</svg>'
        )


def histogram(values: np.ndarray, *, name: str, unit: str, colour: str, bins: int = 30, width: float = 560) -> Markup:
    """Bars of `values` (finite, at least one) with median and 95th percentile marked."""
    low, high = float(values.min()), float(values.max())
    step = next(
        s for s in (0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1e3, 1e4, 1e5, math.inf) if (high - low) / s <= bins
    )
    step = step if math.isfinite(step) else (high - low) / bins
    first, last = math.floor(low / step), math.floor(high / step) + 1
    edges = np.arange(first, last + 1) * step
    counts, _ = np.histogram(values, edges)
    height, top = 190.0, 26.0
    right, bottom = width - _RIGHT, height - _BOTTOM
    most = int(counts.max())

    def u(value: float) -> float:
        return _LEFT + (value - edges[0]) / (edges[-1] - edges[0]) * (right - _LEFT)

    parts = []
    for value in ticks(0, most, about=4):
        v = bottom - value / most * (bottom - top)
        if value == int(value):
            parts.append(f'<path class="grid" d="M{_LEFT} {v:.1f}H{right}"/>')
            parts.append(f'<text class="tick" x="{_LEFT - 5}" y="{v + 3.5:.1f}" text-anchor="end">{value:g}</text>')
    borders = edges.tolist()
    for count, start, end in zip(counts.tolist(), borders, borders[1:], strict=False):
        tall = count / most * (bottom - top)
        tip = f"{start:g} to {end:g} {unit}: {count}"
        parts.append(
            f'<rect x="{u(start) + 0.5:.1f}" y="{bottom - tall:.1f}" width="{max(1.0, u(end) - u(start) - 1):.1f}" '
            f'height="{tall:.1f}" fill="{colour}"><title>{tip}</title></rect>'
        )
    for value in ticks(edges[0], edges[-1], about=7):
        parts.append(f'<text class="tick" x="{u(value):.1f}" y="{bottom + 13}" text-anchor="middle">{value:g}</text>')
    for text, value, v in (("median", np.median(values), top - 14), ("95 %", np.quantile(values, 0.95), top - 3)):
        side, dx = ("start", 4) if u(value) < width * 0.7 else ("end", -4)
        parts.append(f'<path d="M{u(value):.1f} {v - 8}V{bottom}" stroke="#222" stroke-dasharray="3 3"/>')
        parts.append(
            f'<text class="note" x="{u(value) + dx:.1f}" y="{v}" text-anchor="{side}">'
            f"{text} {value:.1f} {escape(unit)}</text>"
        )
    parts.append(
        f'<text class="label" x="{(_LEFT + right) / 2}" y="{bottom + 27}" text-anchor="middle">'
        f"{escape(name)}, {escape(unit)}</text>"
    )
    return Markup(
        f'<svg class="plane" role="img" aria-label="{escape(name)}" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'style="max-width:{width:.0f}px">{"".join(parts)}</svg>'
    )
