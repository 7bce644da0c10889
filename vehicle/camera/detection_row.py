"""Indices of a detection row, (DIM,) float64: a noisy pose of the board, then the sigmas it was drawn with."""

P = 0  # 3, m, world
Q = 3  # 4, world from board, w x y z
SIGMA_LATERAL, SIGMA_DEPTH, SIGMA_ROTATION = 7, 8, 9  # m, m, rad
DIM = 10
