"""Indices of a contact rules row, (DIM,) float64, in the order of the fields of `ContactRules` (contact.py)."""

ROBOT_L, ROBOT_R = 0, 1  # m, the contact disc
BOARD_R, BEHIND_DEPTH = 2, 3  # m
DELTA_D, DELTA_V, DELTA_THETA = 4, 5, 6  # m, m/s, rad
GROUND_Z, WORKSPACE_XY, WORKSPACE_Z = 7, 8, 9  # m
TIME_LIMIT = 10  # s
BOARD_HALF = 11  # m
MAGNET_NORMAL_ERROR = 12  # rad
MAGNET_TANGENTIAL, MAGNET_NORMAL_MIN, MAGNET_NORMAL_MAX = 13, 14, 15  # m/s
DIM = 16
