"""The sealed order of real flights: every flight once, at random, and what was flown compared with it."""

import json

import pytest
from typer.testing import CliRunner

from hil.campaign.draw import compare_list, draw_list, read_list
from hil.campaign.lines import Line
from hil.cli.main import app
from kernel.toml_errors import ConfigError

LISTED = draw_list(["simple-i", "hard-i"], ["planner", "mine.onnx"], 10, "bench", 3)
ORDER = [(one["scenario"], one["policy"]) for one in LISTED["flights"]]


def flown(pairs, identity="real"):
    """Runs of (scenario, policy), one a minute."""
    manifests = [
        {
            "identity": identity, "scenario": {"name": scenario}, "policy": {"name": policy, "sha256": "ab" * 32},
            "wall_clock": {"started_utc": f"2026-01-01T10:{minute:02d}:00Z"},
        }
        for minute, (scenario, policy) in enumerate(pairs)
    ]  # fmt: skip
    return [Line(str(number), manifest, {}) for number, manifest in enumerate(manifests)][::-1]


def test_every_flight_is_drawn_once():
    assert [one["number"] for one in LISTED["flights"]] == list(range(1, 41))
    assert {pair: ORDER.count(pair) for pair in set(ORDER)} == {
        (scenario, policy): 10 for scenario in ("simple-i", "hard-i") for policy in ("planner", "mine.onnx")
    }


def test_order_is_random_and_repeatable():
    again, other = (draw_list(["simple-i", "hard-i"], ["planner", "mine.onnx"], 10, "bench", seed) for seed in (3, 4))
    assert again == LISTED
    assert other["flights"] != LISTED["flights"] and other["sha256"] != LISTED["sha256"]
    first = [draw_list(["simple-i", "hard-i"], ["planner"], 5, "bench", seed)["flights"][0] for seed in range(200)]
    assert 70 < sum(one["scenario"] == "hard-i" for one in first) < 130


def test_list_is_read_as_it_was_drawn(tmp_path):
    path = tmp_path / "flights.json"
    path.write_text(json.dumps(LISTED, indent=2))
    assert read_list(path) == LISTED


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda listed: listed["flights"].reverse(), "was changed after it was drawn"),
        (lambda listed: listed.update(seed=4), "was changed after it was drawn"),
        (lambda listed: listed.pop("sha256"), "is no list of `perch-hil campaign draw`"),
        (lambda listed: listed.clear(), "is no list of `perch-hil campaign draw`"),
    ],
)
def test_list_that_was_changed_is_refused(tmp_path, change, message):
    path, listed = tmp_path / "flights.json", json.loads(json.dumps(LISTED))
    change(listed)
    path.write_text(json.dumps(listed))
    with pytest.raises(ConfigError, match=message):
        read_list(path)


@pytest.mark.parametrize("content", ["", "[]", "{", "7", "\u0000"])
def test_file_that_is_no_list_is_refused(tmp_path, content):
    path = tmp_path / "flights.json"
    path.write_text(content)
    with pytest.raises(ConfigError, match="is no list of"):
        read_list(path)


def test_flights_in_the_order_of_the_list_are_only_counted():
    (remark,) = compare_list(LISTED, flown(ORDER[:7]))
    assert remark == f"7 of the 40 real flights of the sealed list {LISTED['sha256'][:12]} were flown."


def test_first_flight_out_of_order_is_named():
    pairs = [*ORDER[:4], next(pair for pair in ORDER if pair != ORDER[4])]
    _, remark = compare_list(LISTED, flown(pairs))
    assert remark == f"They were not flown as it says: flight 5 was {' with '.join(pairs[4])}."


def test_flight_beyond_the_list_is_named():
    _, remark = compare_list(LISTED, flown([*ORDER, ORDER[0]]))
    assert "flight 41 was" in remark


def test_simulated_flights_are_not_compared_with_the_list():
    assert compare_list(LISTED, flown(ORDER[:7], "sim"))[0].startswith("0 of the 40")


def draw(tmp_path, *words):
    return CliRunner().invoke(app, ["campaign", "draw", *words, "--out", str(tmp_path / "flights.json")])


def test_command_writes_a_sealed_list_and_never_over_one(tmp_path):
    words = ("simple-i", "hard-i", "--rig", "bench", "--policy", "planner", "--flights", "3")
    result = draw(tmp_path, *words)
    assert result.exit_code == 0 and "6 flights, sealed by" in result.stdout
    before = read_list(tmp_path / "flights.json")
    assert len(before["flights"]) == 6 and before["rig"] == "bench"
    again = draw(tmp_path, *words)
    assert again.exit_code == 2 and "cannot be written: File exists" in again.stderr
    assert read_list(tmp_path / "flights.json") == before


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("simple-1", "--rig", "bench", "--policy", "planner"), 'did you mean "simple-i"'),
        (("simple-i", "--rig", "bensh", "--policy", "planner"), 'did you mean "bench"'),
        (("simple-i", "--rig", "bench", "--policy", "plannr"), "use vision, planner"),
        (("simple-i", "simple-i", "--rig", "bench", "--policy", "planner"), "scenario simple-i is given twice"),
        (("simple-i", "--rig", "bench", "--policy", "planner", "--policy", "planner"), "policy planner is given twice"),
    ],
)
def test_list_of_what_cannot_be_flown_is_not_drawn(tmp_path, words, message):
    result = draw(tmp_path, *words)
    assert result.exit_code == 2 and message in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "flights.json").exists()
