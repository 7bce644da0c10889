"""What the commands share: exit codes, the one way to fail, and options that need reading."""

from __future__ import annotations

import sys

import typer

PERCHED, NOT_PERCHED, USAGE, COULD_NOT_RUN, INTERRUPTED = 0, 1, 2, 3, 130


def fail(text: str, code: int = USAGE) -> typer.Exit:
    """Print one line on stderr and return the exit to raise."""
    print(f"perch-hil: {text}", file=sys.stderr)
    return typer.Exit(code)


def parse_seeds(seed: int | None, seeds: str | None) -> range:
    """The seeds asked for by --seed N or --seeds A..B (inclusive); ValueError says what is wrong."""
    if seed is not None and seeds is not None:
        raise ValueError("give --seed or --seeds, not both")
    if seeds is None:
        first = last = 0 if seed is None else seed
    else:
        head, dots, tail = seeds.partition("..")
        if not (dots and head.isdecimal() and tail.isdecimal()):
            raise ValueError(f"--seeds {seeds!r}: write A..B with whole numbers, such as 0..19 (both ends included)")
        first, last = int(head), int(tail)
    if not 0 <= first <= last < 2**32:
        raise ValueError(f"seeds {first}..{last}: they run upwards within 0..{2**32 - 1}")
    return range(first, last + 1)
