"""Indices of a command row, (DIM,): body rates and collective thrust, the action of every policy.

As a command: rad/s (FLU) and m/s^2 along the body z axis. As a normalised action: all in [-1, 1].
"""

RATE = 0  # 3, roll, pitch, yaw
THRUST = 3
DIM = 4
