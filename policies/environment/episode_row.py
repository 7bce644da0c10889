"""Indices of an episode's own row, (DIM,). Times are seconds since the reset; a step is 10 ms."""

STEP, BEGIN, FILLED = 0, 1, 2  # present step; step at which the policy took over; last step of the track known
ACTION = 3  # 4, previous action in [-1, 1], as flown
COMMAND, BEFORE = 7, 11  # 4 each, command (rad/s FLU, m/s^2) flown last and the one before
DELAY = 15  # substeps of physics between asking and the rate loop
EXPOSURE, PERIOD, LATENCY = 16, 17, 18  # next exposure, detector period, exposure to update, s
NOISE, ODOMETRY = 19, 20  # scale of visual noise and of odometry noise
BIAS = 21  # 7, bias row of the visual noise
SEEN, RHO, RETURN = 28, 29, 30  # sums over the episode: steps with the board in view, rho, reward
SPEED, FAMILY, LAW = 31, 32, 33  # m/s, index of FAMILIES, index of LAWS: as drawn
RAW = 34  # 12: newest measurement (5) and its time, the one before (for the ablation without input augmentation)
VISIBLE = 46  # 1 if the board is in view now
ERROR = 47  # m, of the believed position now
PENDING = 48  # detections under way
QUEUE = 49  # QUEUE_LENGTH slots of [arrival, exposure, z (5), r (5)]
QUEUE_LENGTH, SLOT = 8, 12
FORESEEN = QUEUE + QUEUE_LENGTH * SLOT  # last step of the track that is among the row's `ahead`
DIM = FORESEEN + 1
