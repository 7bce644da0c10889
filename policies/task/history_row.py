"""Indices of a history row, float64: a ring of entries (policies.task.entry_row) of the board, one a control step."""

HEAD = 0  # number of the newest entry
FILL = 1  # entries written so far, at most as many as the ring has
RING = 2  # the first entry
