"""Indices of a path row, (DIM,) float64: the path frame in the world, and the numbers of the path's kind."""

X0, Y0 = 0, 1  # m, origin of the path frame in the world
HEADING = 2  # rad, of the path frame's x axis; COS and SIN belong to it
COS, SIN = 3, 4
SIZE = 5  # m: amplitude of the line, radius of racetrack and arc, scale of the figure-8
LENGTH = 6  # m, straight of the racetrack
TURN = 6  # of the arc: 1 counter-clockwise, -1 clockwise; the same place as LENGTH
COUNT = 7  # number of control points of the spline
CONTROL = 8  # x0, y0, x1, y1, ... of the control points in the path frame, m
MAX_CONTROL = 16
DIM = CONTROL + 2 * MAX_CONTROL
