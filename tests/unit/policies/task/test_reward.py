"""Every term against the printed formula, evaluated by hand with plain numbers."""

import math
from dataclasses import replace

import numpy as np
import pytest

from policies.task import contact, result_row, terms_row
from policies.task.contact import ContactRules
from policies.task.reward import RewardWeights, active_perception, closeness, shaping, terminal, total
from vehicle.quadrotor.airframe import load_airframe

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
FLAT = np.array([0.0, 0.0, 1.5, 0.0, 1.0, 0.0, 0.0, 0.0])
ZERO3, ZERO4 = np.zeros(3), np.zeros(4)

DISC = load_airframe("paper_quad").contact


def shape(p, v=ZERO3, q=LEVEL, w=ZERO3, board=FLAT, action=ZERO4, previous=ZERO4, weights=None):
    out = np.zeros(terms_row.DIM)
    shaping(np.array(p), np.array(v), q, np.array(w), board, action, previous, (weights or RewardWeights()).row(), out)
    return out


def test_default_reward_weights_agree_with_the_paper():
    row = RewardWeights().row()
    assert row[:14].tolist() == [1.0, 1.2, 2.7, 1.5, 4.0, 6.0, 1.5, 4.0, -200.0, 900.0, 5.0, 1.5, 0.3, 0.8]
    assert row[14:17].tolist() == [5.0, 4.0, 0.0]


def test_guide_and_align_rewards_are_right_level_over_a_flat_board():
    # 2 m behind, 1 m above: |p_rel| = sqrt(5), no attitude error; v_rel = (1, 0, 0) - (1, 0, 0)
    out = shape([-2.0, 0.0, 2.5], v=[1.0, 0.0, 0.0], w=[0.0, 0.0, 0.5])
    guide = 1.0 / (1.0 + 1.2**2 * 5.0)
    assert out[terms_row.GUIDE] == pytest.approx(guide)
    assert out[terms_row.ALIGN] == pytest.approx(guide * (2.7 * 1.0 + 1.0 + 1.0 / 1.25))


def test_guide_and_align_rewards_are_right_with_attitude_and_velocity_error():
    inclined = FLAT.copy()
    inclined[6] = math.radians(60)
    out = shape([0.0, 0.0, 1.5], v=[1.0, 2.0, 0.0], board=inclined)
    # |z_b - n| = 2 sin(30 deg) = 1; angle 60 deg: phi2 = 0.75^2; v_rel = (0, 2, 0)
    guide = 1.0 / (1.0 + 1.44)
    assert out[terms_row.GUIDE] == pytest.approx(guide)
    assert out[terms_row.ALIGN] == pytest.approx(guide * (2.7 * 0.5625 + 1.0 / (1.0 + 9.0) + 1.0))


def test_action_time_and_aggressiveness_rewards_agree_with_the_paper():
    out = shape([-2.0, 0.0, 2.5], action=np.array([0.6, 0.0, 0.0, 0.8]), previous=np.array([0.6, 0.0, 0.0, 0.3]))
    assert out[terms_row.ACT] == pytest.approx(4.0 * math.exp(-1.0) + 6.0 * math.exp(-0.5))
    assert out[terms_row.TIME] == -4.0
    assert out[terms_row.AGGR] == pytest.approx(1.5)
    fast = shape([-2.0, 0.0, 2.5], v=[0.0, 6.0, 0.0], w=[3.0, 0.0, 4.0])
    assert fast[terms_row.AGGR] == pytest.approx(1.5 * math.exp(-((math.e - 1.0) + (math.e - 1.0))))
    assert shape([-2.0, 0.0, 2.5], v=[0.0, 6.0, 0.0])[terms_row.AGGR] == pytest.approx(1.5 * math.exp(-(math.e - 1.0)))


def test_active_perception_reward_agrees_with_the_paper():
    out, weights = np.zeros(terms_row.DIM), RewardWeights().row()
    active_perception(0.2, 0.9, 0.4, weights, out)
    assert out[terms_row.ESTIMATE] == pytest.approx(-1.5 * (1.0 + 5.0 * 0.5) * 0.2)
    assert out[terms_row.PERCEPTION] == pytest.approx(-0.3 * 0.1)
    active_perception(0.2, 1.0, 9.0, weights, out)
    assert out[terms_row.ESTIMATE] == pytest.approx(-1.5 * 6.0 * 0.2)
    assert out[terms_row.PERCEPTION] == 0.0


def result(outcome, planar=0.1, speed=0.3, angle=0.05, normal=-0.5, made_contact=1.0):
    row = np.zeros(result_row.DIM)
    row[result_row.OUTCOME], row[result_row.TOUCHED] = outcome, made_contact
    row[result_row.PLANAR], row[result_row.TANGENTIAL_SPEED] = planar, speed
    row[result_row.NORMAL_ERROR], row[result_row.NORMAL_SPEED] = angle, normal
    return row


def finish(row, weights=None):
    out = np.zeros(terms_row.DIM)
    terminal(row, ContactRules().row(DISC), (weights or RewardWeights()).row(), out)
    return out


def test_terminal_reward_agrees_with_algorithm_1():
    bonus = (0.5**2 + 0.5**2 + 0.75**2) / 3.0
    assert finish(result(contact.SUCCESS))[terms_row.TERMINAL] == pytest.approx(900.0 * (1.0 + bonus))
    assert finish(result(contact.SUCCESS, 0.0, 0.0, 0.0))[terms_row.TERMINAL] == pytest.approx(1800.0)
    assert finish(result(contact.SUCCESS, 0.2, 0.6, 0.2))[terms_row.TERMINAL] == pytest.approx(900.0)
    assert finish(result(contact.FAIL))[terms_row.TERMINAL] == -200.0
    assert finish(result(contact.ONGOING))[terms_row.TERMINAL] == 0.0


def test_impact_band_and_near_miss_are_off_by_default():
    hard = result(contact.SUCCESS, normal=-1.15)
    assert finish(hard)[terms_row.IMPACT] == 0.0
    weights = replace(RewardWeights(), impact=400.0, miss=0.5)
    assert finish(hard, weights)[terms_row.IMPACT] == pytest.approx(-400.0 * 0.25)
    assert finish(result(contact.SUCCESS, normal=-0.3), weights)[terms_row.IMPACT] == pytest.approx(-400.0 * 0.01)
    assert finish(result(contact.SUCCESS, normal=-0.5), weights)[terms_row.IMPACT] == 0.0
    miss = result(contact.FAIL, planar=0.4, speed=0.6, angle=0.2)
    share = closeness(miss, ContactRules().row(DISC))
    assert share == pytest.approx(1.0 / (1.0 + (4.0 + 1.0 + 1.0) / 3.0))
    assert finish(miss, weights)[terms_row.TERMINAL] == pytest.approx(-200.0 * (1.0 - 0.5 * share))
    assert finish(result(contact.FAIL, made_contact=0.0), weights)[terms_row.TERMINAL] == -200.0


def test_total_reward_is_the_sum_of_its_terms():
    assert total(np.arange(terms_row.DIM, dtype=float)) == pytest.approx(terms_row.DIM * (terms_row.DIM - 1) / 2)
