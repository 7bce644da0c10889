"""Indices of a limits row, (DIM,): what may be asked of a vehicle (`Airframe.limits_row`)."""

THRUST_MIN, THRUST_MAX = 0, 1  # m/s^2, mass-normalised collective thrust
BODY_RATE = 2  # rad/s, about each body axis
DIM = 3
