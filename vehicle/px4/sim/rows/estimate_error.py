"""Indices of the estimate's error row (LENGTH,): correlated errors, then what external vision or its absence adds."""

POSITION, VELOCITY = 0, 3  # 3 each, m, m/s
ATTITUDE = 6  # 3, rad, rotation vector in the body
POSITION_BIAS, VELOCITY_BIAS = 9, 12  # 3 each, m, m/s
YAW_BIAS = 15  # rad
BLIND = 16  # 1: no horizontal position, x and y stay where they were last known
KNOWN_X, KNOWN_Y = 17, 18  # m, the last known position
LENGTH = 19
