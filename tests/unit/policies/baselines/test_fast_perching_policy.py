"""Fast-Perching on the training environment: it perches where its assumption holds."""

from dataclasses import replace

import numpy as np

from policies.evaluation.contenders import open_contender
from policies.evaluation.evaluate import point, run_episodes
from policies.task import result_row
from policies.task.contact import SUCCESS


def flown(name, **changes):
    contender = open_contender(name)
    config = replace(contender.config(None, 3), count=4, **{**point(1.0, 30.0), **changes})
    return run_episodes(contender.policy, config)


def test_fast_perching_perches_on_a_board_on_a_straight_line():
    ended = flown("fast-perching", families=(0, 1.0, 0, 0, 0, 0), laws=(1.0, 0, 0, 0))
    assert np.count_nonzero(ended[:, result_row.OUTCOME] == SUCCESS) >= 3


def test_turn_rate_in_the_prediction_raises_success_on_a_circle():
    circle = {**point(3.0, 0.0), "families": (0, 0, 0, 0, 1.0, 0), "laws": (1.0, 0, 0, 0)}
    flights = flown("fast-perching", **circle), flown("fast-perching-ctrv", **circle)
    hits = [np.count_nonzero(rows[:, result_row.OUTCOME] == SUCCESS) for rows in flights]
    assert hits[1] > hits[0]
