"""Indices of a thrust and drag row, (DIM,) float64 (policies.estimation.thrust_drag)."""

GAIN = 0  # achieved over asked thrust
LAGGED = 1  # m/s^2, asked thrust after the motors' lag
UU, SU = 2, 3  # sums of the regression for the gain
STARTED = 4  # 1 once a control step was seen
V, Z = 5, 8  # 3 each, velocity (m/s) and body z axis (world) of the control step before
DRAG = 11  # 1/s
VV, FV = 12, 13  # sums of the regression for the drag
DIM = 14
