"""Indices of a contact result row, (DIM,) float64, filled by `policies.task.contact.evaluate`."""

OUTCOME, REASON = 0, 1  # codes of policies.task.contact
TOUCHED, WITHIN, ATTACHED = 2, 3, 4  # 0 or 1
X, Y = 5, 6  # m, board frame: centre of the contact disc
HEIGHT = 7  # m, of the contact disc's lowest point over the board's plane
NORMAL_ERROR = 8  # rad, between body z and the board's normal
NORMAL_SPEED, TANGENTIAL_SPEED = 9, 10  # m/s relative to the board; the normal one is negative into the board
PLANAR = 11  # m, tangential distance from the board's centre
DIM = 12
