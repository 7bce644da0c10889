"""Indices of a predictor's history row, float64: a ring of entries of the belief (policies.prediction.learned)."""

COUNT = 0  # entries written so far, at most as many as the ring has
HEAD = 1  # number of the newest entry
TIME = 2  # s, of the newest entry
RING = 3  # the first entry

X, Y = 0, 1  # from an entry's first number: m, world
SPEED, TURN_RATE, ACCELERATION = 2, 3, 4  # m/s, rad/s, m/s^2
AGE = 5  # s, of the newest exposure
ENTRY_DIM = 6
