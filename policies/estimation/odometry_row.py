"""Indices of the odometry predicted to now, (DIM,) float64 (policies.estimation.odometry)."""

P = 0  # 3, m, world
V = 3  # 3, m/s, world
Q = 6  # 4, world from body, w x y z
DIM = 10
