"""Indices of the board's row at a time of a plan, (DIM,), world ENU. Three elements each, except the last."""

from __future__ import annotations

POSITION = 0  # m
VELOCITY = 3  # m/s
NORMAL = 6
ACROSS = 9  # tangent, horizontal, to the left
ALONG = 12  # tangent, up the slope
TURN = 15  # rad/s, turn rate
DIM = 16
