"""Indices of a speed row, (DIM,) float64: the numbers of one speed law (groundcar.motion.speed_laws)."""

V = 0  # m/s: speed of CONSTANT and OU, minimum of COSINE, first of SCHEDULED
V2 = 1  # m/s: maximum of COSINE, second of SCHEDULED
PERIOD = 2  # s, of COSINE
RAMP = 2  # s, of SCHEDULED; the same place as PERIOD
PHASE = 3  # rad, of COSINE
SWITCH = 4  # s, when SCHEDULED begins to change; inf: not yet known
TAU, SIGMA = 5, 6  # s and 1, of the OU factor; with SIGMA 0 no random number is drawn
DIM = 8
