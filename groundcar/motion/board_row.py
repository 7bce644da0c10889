"""Indices of a board row, (DIM,) float64: where the board is and how it moves. Worlds are ENU, angles in rad."""

X, Y, Z = 0, 1, 2  # m, world: centre of the board's face
HEADING = 3  # rad, counter-clockwise from the world's x axis
SPEED = 4  # m/s along the heading, negative backwards
TURN_RATE = 5  # rad/s
INCLINATION = 6  # rad, 0 faces up
U = 7  # path parameter, in the path's own unit (groundcar.motion.paths); 0 where the path is not known
DIM = 8
