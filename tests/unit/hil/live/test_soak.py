"""The soak's verdict: growth and lateness are faults, settling and a constant load are not."""

import tomllib

import pytest

from hil.live.soak import SAMPLE_S, Sample, Samples, judge, judge_shared, stretched
from kernel.toml_errors import ConfigError
from scenarios.spec import list_scenarios, load


def samples(count=60, *, own_kb=lambda t: 200_000.0, late=lambda t: 0.0):
    """`late` is the share of late steps at a time; 100 steps a second."""
    found, total = [], 0.0
    for number in range(count):
        at_s = number * SAMPLE_S
        total += late(at_s) * 100 * SAMPLE_S
        found.append(Sample(at_s, own_kb(at_s), round(100 * at_s), round(total)))
    return found


def test_service_with_constant_memory_passes():
    verdict = judge("brain", samples(late=lambda t: 0.05))
    assert verdict.faults == ()
    assert verdict.growth_kb == 0.0
    assert verdict.early == pytest.approx(0.05, abs=0.005)


def test_memory_leak_is_reported_with_its_size():
    (fault,) = judge("brain", samples(own_kb=lambda t: 200_000 + 200 * t)).faults
    assert fault.startswith("memory grew by 1")


def test_memory_growth_at_the_start_is_not_a_leak():
    assert judge("brain", samples(own_kb=lambda t: 200_000 + 3000 * min(t, 18.0))).faults == ()


def test_growing_lateness_is_reported():
    (fault,) = judge("brain", samples(late=lambda t: 0.002 * t)).faults
    assert fault.startswith("late steps grew from")


def test_too_short_a_soak_has_no_verdict():
    assert judge("brain", samples(12)).faults == ("too short to tell",)


def test_growing_count_of_shared_memory_files_is_reported():
    def counted(count):
        return [(number * SAMPLE_S, count(number)) for number in range(60)]

    assert judge_shared(counted(lambda number: 3 if number < 5 else 17)) == []
    (verdict,) = judge_shared(counted(lambda number: 17 + number // 30))
    assert verdict.faults == ("files in shared memory grew from 17 to 18",)


def test_samples_are_taken_after_the_lead_and_count_missed_steps_as_late():
    samples = Samples()
    table = {
        "own_kb": 5,
        "memory": ["1.zenoh", "2.zenoh"],
        "nodes": {"a": {"steps": 10, "late": 1, "missed": 2}, "b": {"steps": 5, "late": 0, "missed": 0}},
    }
    samples.look({"brain": table}, 0.0)
    assert samples.samples == {}  # the lead has not begun
    samples.stage(0, "prepare")
    samples.look({"brain": table}, 0.0)
    assert samples.samples == {}
    samples.stage(1, "lead")
    for tenth in range(0, 41):
        samples.look({"brain": table, "hub": {}}, tenth / 10)
    assert samples.samples == {"brain": [Sample(at, 5.0, 17, 3) for at in (0.0, 2.0, 4.0)]}


@pytest.mark.parametrize("name", list_scenarios())
def test_stretched_scenario_differs_only_in_its_lead(name, tmp_path):
    path = stretched(name, 2.5, tmp_path)
    assert tomllib.loads(path.read_text())["car"]["lead"] == 150.0
    long, short = load(path), load(name)
    assert long.car.lead == 150.0
    assert long.model_copy(update={"car": short.car}) == short


def test_unknown_scenario_of_a_soak_is_refused(tmp_path):
    with pytest.raises(ConfigError, match="there is no scenario"):
        stretched("hard-iii", 1.0, tmp_path)
