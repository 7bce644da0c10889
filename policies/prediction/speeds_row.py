"""Indices of a speed history row, float64: a ring of believed speeds (policies.prediction.speed_history)."""

COUNT = 0  # entries written so far, at most as many as the ring has
HEAD = 1  # number of the newest entry
TIME = 2  # s, of the newest entry
RING = 3  # m/s, the first entry
