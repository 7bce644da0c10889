"""Output on stdout: tables that fit 80 columns, lines that are not broken in a pipe, or one JSON value."""

from __future__ import annotations

import json
import math
from typing import Any

from rich.console import Console

PIPE_WIDTH = 80  # characters of a table where stdout is no terminal


def screen() -> Console:
    """The console of stdout: as wide as the terminal, `PIPE_WIDTH` elsewhere."""
    console = Console()
    return console if console.is_terminal else Console(width=PIPE_WIDTH)


def say(text: str) -> None:
    """Print lines of text; in a pipe none of them is broken."""
    console = screen()
    console.print(text, highlight=False, markup=False, soft_wrap=not console.is_terminal)


def print_json(value: Any) -> None:
    """Print one JSON value on one line; numbers that are not finite, which JSON lacks, become null."""
    print(json.dumps(_finite(value), allow_nan=False), flush=True)


def _finite(value: Any) -> Any:
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(inner) for inner in value]
    return value
