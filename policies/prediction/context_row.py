"""Indices of a training example's context, (DIM,): the belief that the predictor started from."""

SPEED, TURN_RATE, ACCELERATION = 0, 1, 2  # m/s, rad/s, m/s^2
SIGMA, SPEED_SIGMA = 3, 4  # m, m/s
AGE = 5  # s, of the newest exposure
STREAK = 6  # measurements accepted since the last start
HISTORY = 7  # s
DIM = 8
