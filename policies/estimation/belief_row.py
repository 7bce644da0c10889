"""Indices of a belief row, (DIM,) float64: one filter (policies.estimation.board_ekf). Times in s of its own origin."""

from policies.estimation import belief_state, measured_row

MODEL_COUNT = 2  # calm and lively (policies.estimation.imm)
MODEL_DIM = belief_state.DIM + belief_state.DIM**2  # state, then covariance (row-major)

STATE = 0  # belief_state.DIM
COVARIANCE = belief_state.DIM  # belief_state.DIM squared, row-major
TIME = MODEL_DIM  # s, exposure time of the newest accepted measurement
FIRST_TIME = TIME + 1  # s, of the first accepted one since the last start or restart
ACCEPTED, REJECTED = TIME + 2, TIME + 3  # counts
NIS = TIME + 4  # normalised innovation squared of the newest measurement that reached the innovation test
STREAK = TIME + 5  # accepted since the last start or restart; 0: nothing is known
CANDIDATES = TIME + 6  # refused in a row that agree with each other
CANDIDATE_TIME = TIME + 7  # s, of the newest of them
CANDIDATE = TIME + 8  # the newest of them, measured_row.DIM
WEIGHTS = CANDIDATE + measured_row.DIM  # probability of each model
MODELS = WEIGHTS + MODEL_COUNT  # MODEL_DIM for each model
TRIAL = MODELS + MODEL_COUNT * MODEL_DIM  # from here on workspace of one update
PRIOR = TRIAL + MODEL_COUNT * MODEL_DIM
MISFIT = PRIOR + MODEL_COUNT
DIM = MISFIT + 2 * MODEL_COUNT
