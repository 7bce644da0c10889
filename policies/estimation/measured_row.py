"""Indices of a measurement of the board, (DIM,), and of its variances."""

X, Y, Z = 0, 1, 2  # m, world
HEADING, INCLINATION = 3, 4  # rad
DIM = 5
