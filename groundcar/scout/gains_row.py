"""Indices of the follower's gains row, (DIM,) float64 (groundcar.scout.follower)."""

ALONG = 0  # 1/s
ACROSS = 1  # rad/m^2
HEADING = 2  # rad/s
CORRECTION = 3  # m/s, limit of the speed correction
SPEED_LIMIT, TURN_RATE_LIMIT = 4, 5  # m/s, rad/s
DIM = 6
