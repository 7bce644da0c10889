"""Indices of one history entry, (DIM,) numbers: the board at one time.

In a history row the entry is in the world; in an observation it is relative to the vehicle, in its yaw frame.
"""

P = 0  # 3, m
NORMAL = 3  # 3, outward unit normal
V = 6  # 2, m/s, horizontal
TURN_RATE = 8  # rad/s
TIME = 9  # s
DIM = 10
