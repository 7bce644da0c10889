"""Indices of a coast row, (DIM,) float64: the last good prediction (policies.prediction.coast)."""

from groundcar.motion import board_row
from policies.prediction.future import HORIZON

TIME = 0  # s, of the kept prediction's first row
KEPT = 1  # 1 if a prediction is kept
FUTURE = 2  # its board rows, HORIZON of them
DIM = FUTURE + board_row.DIM * HORIZON
