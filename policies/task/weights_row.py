"""Indices of a reward weights row, (DIM,) float64, in the order of the fields of `policies.task.reward.RewardWeights`.

The paper's names: lambda_1 to lambda_8 are GUIDE to TIME, lambda_f FAILURE, lambda_s SUCCESS.
"""

GUIDE, POSE_SCALE, AXIS, VELOCITY, ACTION, SMOOTHNESS, AGGRESSIVENESS, TIME = 0, 1, 2, 3, 4, 5, 6, 7
FAILURE, SUCCESS = 8, 9
ALPHA, BETA, GAMMA = 10, 11, 12
TAU = 13  # s
V_LIM, W_LIM = 14, 15  # m/s, rad/s
IMPACT = 16
IMPACT_LOW, IMPACT_HIGH = 17, 18  # m/s, into the board
MISS = 19
DIM = 20
