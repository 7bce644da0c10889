"""Indices of the belief's state, (DIM,): a board row whose last number is the acceleration, then the heading bias.

What is predicted for others leaves the bias out: (PREDICTED_DIM,).
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
