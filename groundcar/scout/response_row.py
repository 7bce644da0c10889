"""Indices of the simulated car's parameter row, (DIM,) float64 (groundcar.scout.physics); SI units."""

FREQUENCY, DAMPING, ACCELERATION, STOP_DECELERATION, SPEED_GAIN = 0, 1, 2, 3, 4
TURN_LAG, TURN_ACCELERATION, TURN_GAIN, VEER = 5, 6, 7, 8
SPEED_SIGMA, SPEED_TIME, TURN_SIGMA, TURN_TIME = 9, 10, 11, 12
TRACK = 13
DIM = 14
