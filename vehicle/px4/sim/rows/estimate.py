"""Indices of the estimate row (LENGTH,): what the autopilot takes for its state. World ENU, body FLU, SI units."""

POSITION = 0  # 3, m
VELOCITY = 3  # 3, m/s
ATTITUDE = 6  # 4, quaternion w x y z, world from body
RATE = 10  # 3, rad/s, body
LENGTH = 13
