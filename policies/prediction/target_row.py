"""Indices of one target of a training example, (DIM,): the true board later, in the frame of the believed board now."""

X, Y = 0, 1  # m
HEADING = 2  # rad
SPEED = 3  # m/s
DIM = 4
