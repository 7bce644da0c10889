"""Indices of the belief's state, (DIM,): a board row with the acceleration in place of U, then the heading bias.

A prediction that leaves the filter has no heading bias: (PREDICTED_DIM,).
"""

from groundcar.motion.board_row import HEADING, INCLINATION, SPEED, TURN_RATE, X, Y, Z

__all__ = [
    "ACCELERATION",
    "DIM",
    "HEADING",
    "HEADING_BIAS",
    "INCLINATION",
    "PREDICTED_DIM",
    "SPEED",
    "TURN_RATE",
    "X",
    "Y",
    "Z",
]

ACCELERATION = 7  # m/s^2, along the heading
PREDICTED_DIM = 8
HEADING_BIAS = 8  # rad, measured minus true heading
DIM = 9
