"""Fault tables: conditions, times, and what is refused."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kernel.toml_errors import ConfigError, validate
from scenarios.faults import QUANTITIES, Condition, FaultFile, FaultTable
from scenarios.spec import Scenario, load


def fault(**values):
    return FaultTable.model_validate({"kind": "camera.frozen", **values})


def test_number_is_seconds_of_the_attempt():
    condition = fault(at=1.5).condition
    assert not condition.holds({"time": None}) and not condition.holds({"time": 1.4})
    assert condition.holds({"time": 1.5})


@pytest.mark.parametrize(
    ("text", "situation", "holds"),
    [
        ("distance < 2.0", {"distance": 1.9}, True),
        ("distance < 2.0", {"distance": 2.0}, False),
        ("distance < 2.0", {"distance": None}, False),
        ('stage == "attempt"', {"stage": "attempt"}, True),
        ('stage != "attempt"', {"stage": "lead"}, True),
        ("detections >= 5 and height > -1", {"detections": 5, "height": 0.0}, True),
        ("detections >= 5 and height > 2", {"detections": 5, "height": 0.0}, False),
        ("phase == 'parameters'", {"phase": "parameters"}, True),
    ],
)
def test_condition_holds_where_all_its_comparisons_do(text, situation, holds):
    assert Condition.read(text).holds(situation) is holds


@pytest.mark.parametrize(
    ("at", "message"),
    [
        ("distnace < 2", 'unknown quantity "distnace"; did you mean "distance"\\?'),
        ("distance ~ 2", "is no condition"),
        ("distance < near", "is no condition"),
        ('distance < "near"', "compares distance"),
        ("stage == 3", "compares stage"),
        ('stage > "lead"', "compares stage"),
        ('stage == "atempt"', 'there is no stage "atempt"; did you mean "attempt"\\?'),
        ("", "is no condition"),
        (-1.0, "not negative"),
    ],
)
def test_condition_that_cannot_be_meant_is_refused(at, message):
    with pytest.raises(ValueError, match=message):
        fault(at=at)


@pytest.mark.parametrize("lasts", [0, -1.0, float("inf"), "1", True])
def test_duration_must_be_positive(lasts):
    with pytest.raises(ValueError, match="for is"):
        fault(**{"for": lasts})


def test_table_survives_a_manifest():
    one = fault(at="distance < 2", **{"for": 0.5, "share": 0.25})
    again = FaultTable.model_validate(one.model_dump(mode="json"))
    assert again == one and again.lasts_s == 0.5 and again.parameters == {"share": 0.25}
    scenario = load("simple-i").model_copy(update={"fault": (one,)})
    assert Scenario.model_validate(scenario.model_dump(mode="json")).fault == (one,)


def test_tables_of_one_name_are_one_case_of_a_campaign():
    file = FaultFile(fault=(fault(name="a"), fault(), fault(name="a", seed=1)))
    assert {name: len(tables) for name, tables in file.cases.items()} == {"a": 2, "camera.frozen": 1}


def test_file_without_faults_is_refused():
    with pytest.raises(ConfigError, match="no \\[\\[fault\\]\\] table"):
        validate({"fault": []}, FaultFile, "faults.toml")
    with pytest.raises(ConfigError, match=r'faults.toml: fault 1: key "kind" is missing'):
        validate({"fault": [{"at": 1.0}]}, FaultFile, "faults.toml")


@given(st.text(max_size=40))
def test_any_text_is_read_or_refused_with_a_sentence(text):
    try:
        condition = Condition.read(text)
    except ValueError as error:
        assert str(error)
    else:
        assert {name for name, _, _ in condition.terms} <= set(QUANTITIES)
