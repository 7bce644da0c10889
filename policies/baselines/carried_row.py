"""The board at some time of a plan, as a row (DIM,) in world ENU; three elements each but for the last."""

from __future__ import annotations

POSITION = 0  # m
VELOCITY = 3  # m/s
NORMAL = 6
ACROSS = 9  # tangent, horizontal, to the left
ALONG = 12  # tangent, up the slope
TURN = 15  # rad/s, turn rate
DIM = 16
