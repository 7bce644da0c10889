"""What the rows and columns of printed tables mean: shown under the table and in the command's `--help`."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TypeVar

Command = TypeVar("Command", bound=Callable[..., None])

EVALUATION = (
    "T1, T2, T3: the paper's points (3 m/s flat, 2 m/s at 30 deg, 1 m/s at 60 deg). 2.0@70: 2 m/s at 70 deg. "
    "hard-i-like: oscillating from 1 to 2.5 m/s at 70 deg. paper-training, own-training: the paper's and the project's "
    "ranges of training.\n\n"
    "perched: attached and within tolerance; 95 %: its exact interval. Means over the flights that perched: time to "
    "contact, pos from the board's centre, angle from body z to the board's normal, v_t along the board, v_n into it. "
    "seen: share of the time with the board in the camera's view."
)
FLIGHTS = (
    "At contact: planar, from the board's centre to the magnet; normal, from body z to the board's normal; along and "
    "into, speed along the board and into it (negative). time: of the attempt. attached: the magnet held. within "
    "tolerance: the paper's three limits were kept."
)
RUNS = (
    "Numbers at contact: m, from the board's centre to the magnet; deg, from body z to the board's normal; m/s, along "
    "the board."
)
CAMPAIGN = (
    "within tolerance: the paper's three limits were kept at contact. attached: the magnet held. In brackets: exact "
    "95 % interval."
)


def explained(legend: str) -> Callable[[Command], Command]:
    """Put `legend` at the end of the command's help."""

    def mark(command: Command) -> Command:
        command.__doc__ = f"{inspect.cleandoc(command.__doc__ or '')}\n\n{legend}"
        return command

    return mark
