"""Printable files of boards at true size: PDF or SVG (vector) or PNG, chosen by the file's suffix."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from groundcar.board.face import bitmap, rectangles
from groundcar.board.layout import Board

POINT = 0.0254 / 72  # m, PDF's unit
_MARGIN = 0.015  # m around the face for the caption; outside the cut line
_CAPTION = "print at 100 %; the line below is 100 mm"


@dataclass(frozen=True)
class Sheet:
    """What is printed: a square bitmap ((modules, modules) uint8, 0 black or 255 white), its module (m), a caption."""

    bitmap: np.ndarray
    module: float
    caption: str = _CAPTION

    @property
    def size(self) -> float:
        """Edge of the face, m."""
        return len(self.bitmap) * self.module


def write_printable(path: str | Path, board: Board | None = None, dpi: int = 600) -> Path:
    """Write the board to `path`; see `write_sheet`."""
    board = board or Board()
    return write_sheet(path, Sheet(bitmap(board), board.module, f"{_CAPTION}; this side is down-slope"), dpi)


def write_sheet(path: str | Path, sheet: Sheet, dpi: int = 600) -> Path:
    """Write `sheet` to `path` (.pdf, .svg or .png). Returns the path; ValueError for another suffix.

    Vector files carry a cut line, a caption and a 100 mm line to check the printer's scale; the PNG is the bare face,
    one module a whole number of pixels, at the nearest resolution to `dpi` that allows it.
    """
    path = Path(path)
    writer = {".pdf": _pdf, ".svg": _svg, ".png": _png}.get(path.suffix.lower())
    if writer is None:
        raise ValueError(f"cannot print the board to {path.name!r}: use .pdf, .svg or .png")
    path.write_bytes(writer(sheet, dpi))
    return path


def _boxes(sheet: Sheet, unit: float) -> list[tuple[float, float, float, float]]:
    """Black rectangles (x, y, width, height) from the top left of the page, in 1/unit metres."""
    m = sheet.module
    return [((c * m + _MARGIN) / unit, (r * m + _MARGIN) / unit, w * m / unit, h * m / unit)
            for r, c, h, w in rectangles(sheet.bitmap)]  # fmt: skip


def _svg(sheet: Sheet, dpi: int) -> bytes:
    page, face, margin = (sheet.size + 2 * _MARGIN) * 1e3, sheet.size * 1e3, _MARGIN * 1e3
    rects = "".join(f"M{x:.3f} {y:.3f}h{w:.3f}v{h:.3f}h{-w:.3f}z" for x, y, w, h in _boxes(sheet, 1e-3))
    foot = page - margin
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{page:.3f}mm" height="{page:.3f}mm" '
        f'viewBox="0 0 {page:.3f} {page:.3f}">\n'
        f'<rect width="{page:.3f}" height="{page:.3f}" fill="#fff"/>\n'
        f'<rect x="{margin}" y="{margin}" width="{face:.3f}" height="{face:.3f}" fill="none" stroke="#bbb" '
        f'stroke-width="0.1"/>\n'
        f'<path d="{rects}" fill="#000"/>\n'
        f'<text x="{margin}" y="{foot + 5}" font-family="sans-serif" font-size="4">{sheet.caption}</text>\n'
        f'<path d="M{margin} {foot + 9}h100" stroke="#000" stroke-width="0.3"/>\n</svg>\n'
    ).encode()


def _pdf(sheet: Sheet, dpi: int) -> bytes:
    page, margin, face = (sheet.size + 2 * _MARGIN) / POINT, _MARGIN / POINT, sheet.size / POINT
    boxes = "".join(f"{x:.4f} {page - y - h:.4f} {w:.4f} {h:.4f} re\n" for x, y, w, h in _boxes(sheet, POINT))
    mm = 1e-3 / POINT
    content = (
        f"0.7 G 0.3 w {margin:.4f} {margin:.4f} {face:.4f} {face:.4f} re S\n0 g\n{boxes}f\n"
        f"BT /F1 11 Tf {margin:.3f} {margin - 5 * mm:.3f} Td ({sheet.caption}) Tj ET\n"
        f"0 G 0.8 w {margin:.4f} {margin - 9 * mm:.4f} m {margin + 100 * mm:.4f} {margin - 9 * mm:.4f} l S\n"
    )
    return pdf_document([(page, page, content)])


def pdf_document(pages: Sequence[tuple[float, float, str]]) -> bytes:
    """A PDF file of `pages`: width and height in points, and what is drawn (PDF operators, /F1 is Helvetica)."""
    kids = " ".join(f"{4 + 2 * number} 0 R" for number in range(len(pages)))
    objects = [
        b"<< /Type /Catalog /Pages 2 0 R >>",
        f"<< /Type /Pages /Kids [{kids}] /Count {len(pages)} >>".encode(),
        b"<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
    ]
    for width, height, drawn in pages:
        content = drawn.encode()
        objects.append(
            f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {width:.4f} {height:.4f}] "
            f"/Contents {len(objects) + 2} 0 R /Resources << /Font << /F1 3 0 R >> >> >>".encode()
        )
        objects.append(b"<< /Length %d >>\nstream\n%s\nendstream" % (len(content), content))
    out, offsets = b"%PDF-1.4\n", []
    for number, body in enumerate(objects, 1):
        offsets.append(len(out))
        out += b"%d 0 obj\n%s\nendobj\n" % (number, body)
    table = b"".join(b"%010d 00000 n \n" % offset for offset in offsets)
    size = len(objects) + 1
    trailer = b"trailer << /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n" % (size, len(out))
    return out + b"xref\n0 %d\n0000000000 65535 f \n" % size + table + trailer


def _png(sheet: Sheet, dpi: int) -> bytes:
    scale = max(1, round(sheet.module * dpi / 0.0254))
    face = np.kron(sheet.bitmap, np.ones((scale, scale), np.uint8))
    data = cv2.imencode(".png", face)[1].tobytes()
    # Without pHYs the viewer chooses a PNG's printed size: write the pixels per metre
    physical = b"pHYs" + struct.pack(">IIB", round(scale / sheet.module), round(scale / sheet.module), 1)
    chunk = struct.pack(">I", 9) + physical + struct.pack(">I", zlib.crc32(physical))
    header_end = 8 + 25
    return data[:header_end] + chunk + data[header_end:]
