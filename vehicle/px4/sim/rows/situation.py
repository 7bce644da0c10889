"""Indices of the situation row (LENGTH,): what the vehicle's body may do."""

ARMED = 0  # 0 or 1
GROUND = 1  # m, height at which the centre of mass rests
ATTACHED = 2  # 0 or 1: the magnet holds
RESTING = 3  # 0 or 1, a result: the body stands on the ground
HEALTH = 4  # 4, what is left of each motor's thrust, 0..1
LENGTH = 8
