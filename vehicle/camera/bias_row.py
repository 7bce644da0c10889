"""Indices of a bias row, (DIM,) float64: systematic error of the detections of one episode."""

P = 0  # 3, m, world
Q = 3  # 4, w x y z, in the board frame
DIM = 7
