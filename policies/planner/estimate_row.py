"""Indices of an estimate row, (DIM,): how well the board is known to the planner."""

from __future__ import annotations

VALID = 0  # 1: the belief is valid
SIGMA, SPEED_SIGMA = 1, 2  # m, m/s: one-sigma of horizontal position and of speed; 0: known exactly
AGE = 3  # s since the newest exposure
STREAK = 4  # accepted detections in a row
SURPRISE = 5  # m/s, rms error of the prediction of the newest speeds
SURFACE = 6  # m, one-sigma of the board's surface along its normal
DIM = 7
