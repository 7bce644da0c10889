"""The networks that ship perch as often as docs/results.md says: a loss of five points fails here.

Each bound follows from the committed results: it is met by chance in 1 of 100 at most where the rate has fallen by
FALL. The episodes are others than those of the results.
"""

from dataclasses import replace

import pytest
from scipy.stats import binom

from hil.results.experiments import EXPERIMENTS
from hil.results.measure import kept
from policies.evaluation.contenders import open_contender
from policies.evaluation.evaluate import POINTS, changed, evaluation_seed, fly_cases
from tests.paths import ROOT

EPISODES, SEED = 1000, 77
FALL = 0.05
CHANCE = 0.01

pytestmark = [pytest.mark.slow, pytest.mark.timeout(900)]


def results(name):
    (experiment,) = [one for one in EXPERIMENTS if one.name == name]
    found = kept(experiment, ROOT / "results")
    if found is None:
        pytest.skip(f"not measured: perch-hil results {name}")
    return found["data"]


def least_hits(rate, trials, fall):
    """The smallest count that a policy of `rate - fall` reaches with a probability of at most CHANCE."""
    return int(binom.isf(CHANCE, trials, rate - fall)) + 1


def test_bound_is_broken_by_the_fall_and_met_by_the_rate():
    bound = least_hits(0.95, EPISODES, FALL)
    assert binom.sf(bound - 1, EPISODES, 0.90) <= CHANCE < binom.sf(bound - 2, EPISODES, 0.90)
    assert binom.sf(bound - 1, EPISODES, 0.95) > 0.999


@pytest.mark.parametrize(
    ("experiment", "policy", "noise"),
    [("vision-published", "vision", "paper"), ("vision-measured", "vision", "measured"), ("state", "state", "paper")],
)
@pytest.mark.parametrize("point", ["T1", "T2", "T3"])
def test_network_perches_as_often_as_published(experiment, policy, noise, point):
    (published,) = [row for row in results(experiment)["points"] if row["name"] == point]
    contender = open_contender(policy)
    config = replace(contender.config(None, evaluation_seed(SEED)), count=EPISODES)
    (row,) = fly_cases(contender.policy, changed(config, {point: POINTS[point]}), noise)
    assert row.hits >= least_hits(published["success"] / 100.0, EPISODES, FALL), row
