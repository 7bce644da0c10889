import pytest

from hil.bench.reading import NotApplicable, Unavailable
from hil.check import records
from hil.check.judge import Outcome, Reading
from hil.check.records import GO, INCOMPLETE, NO_GO
from hil.check.session import Answer
from tests.unit.hil.check.made_up import PASS, NoOperator, Operator, checklist, record_of, registered, run_session

FAIL, SKIP, BACK = Answer(Outcome.FAIL, "cracked"), Answer(Outcome.SKIPPED, "no camera"), Answer(Outcome.PENDING)


def automatic(function, tmp_path, **item):
    made = checklist([{"check": "test.it", **item}])
    with registered("test.it", function, "s"):
        record = record_of(made)
        run_session(made, record, tmp_path)
    return record.entries[0], record.exit_code()


def raising(error):
    def function(context):
        raise error

    return function


@pytest.mark.parametrize(
    ("function", "item", "outcome", "code"),
    [
        (lambda context: Reading(1.0), {"max": 2}, Outcome.PASS, GO),
        (lambda context: Reading(1.0), {"max": 2, "marginal_max": 0.5}, Outcome.MARGINAL, GO),
        (lambda context: Reading(3.0), {"max": 2}, Outcome.FAIL, NO_GO),
        (lambda context: Reading(None), {"max": 2}, Outcome.FAIL, NO_GO),
        (lambda context: Reading(float("nan")), {"max": 2}, Outcome.UNKNOWN, INCOMPLETE),
        (raising(Unavailable("unplugged")), {"max": 2}, Outcome.UNKNOWN, INCOMPLETE),
        (raising(Unavailable("unplugged")), {"max": 2, "optional": True}, Outcome.UNKNOWN, GO),
        (raising(ZeroDivisionError("oops")), {}, Outcome.UNKNOWN, INCOMPLETE),
        (raising(NotApplicable("built in")), {"max": 2}, Outcome.SKIPPED, GO),
        (lambda context: Reading(1.0), {"when": "real", "max": 0}, Outcome.SKIPPED, GO),
    ],
)
def test_every_outcome_of_an_automatic_item(function, item, outcome, code, tmp_path):
    entry, got = automatic(function, tmp_path, **item)
    assert (entry.outcome, got) == (outcome, code)
    if outcome is not Outcome.PASS:
        assert entry.reason
    saved = records.read(tmp_path / "record.json").entries[0]
    assert saved == entry
    assert saved.utc.endswith("Z")
    assert saved.operator == "Ann"


def test_an_item_carries_value_limit_margin_unit_source_and_time(tmp_path):
    entry, _ = automatic(lambda context: Reading(1.25, "detail", "bench"), tmp_path, max=2)
    assert (entry.value, entry.limit, entry.margin, entry.unit) == (1.25, "at most 2 s", 0.75, "s")
    assert (entry.source, entry.detail) == ("bench", "detail")
    assert entry.seconds is not None


def test_check_that_raises_is_unknown_and_the_rest_continues(tmp_path):
    entry, _ = automatic(raising(KeyError("gone")), tmp_path)
    assert entry.reason == "the check raised KeyError: 'gone'"


@pytest.mark.parametrize(
    ("answer", "outcome", "code"), [(PASS, Outcome.PASS, GO), (FAIL, Outcome.FAIL, NO_GO), (SKIP, Outcome.SKIPPED, GO)]
)
def test_every_answer_to_a_manual_item(answer, outcome, code, tmp_path):
    made = checklist([{"ask": "Well?"}])
    record = record_of(made)
    run_session(made, record, tmp_path, Operator({"Well?": [answer]}))
    entry = record.entries[0]
    assert (entry.outcome, entry.reason, record.exit_code()) == (outcome, answer.reason, code)


@pytest.mark.parametrize(
    ("value", "outcome"), [(0.4, Outcome.PASS), (0.55, Outcome.MARGINAL), (0.7, Outcome.FAIL), (None, Outcome.FAIL)]
)
def test_a_manual_measurement_is_judged_and_unset_fails(value, outcome, tmp_path):
    made = checklist([{"ask": "How long?", "unit": "s", "max": 0.6, "marginal_max": 0.5}])
    record = record_of(made)
    run_session(made, record, tmp_path, Operator({"How long?": [Answer(Outcome.PASS, value=value)]}))
    assert record.entries[0].outcome is outcome
    assert record.entries[0].value == value


def test_without_a_terminal_manual_items_are_unknown_and_the_result_incomplete(tmp_path):
    made = checklist([{"ask": "Well?"}], [{"ask": "And?"}])
    record = record_of(made)
    run_session(made, record, tmp_path, NoOperator())
    assert [e.outcome for e in record.entries] == [Outcome.UNKNOWN, Outcome.PENDING]
    assert record.exit_code() == INCOMPLETE


def test_group_stays_closed_until_the_previous_group_passed(tmp_path):
    made = checklist([{"ask": "A"}, {"ask": "B"}], [{"ask": "C"}])
    record = record_of(made)
    interface = run_session(made, record, tmp_path, Operator({"A": [FAIL]}))
    assert interface.asked == ["A", "B"]
    assert [e.outcome for e in record.entries] == [Outcome.FAIL, Outcome.PASS, Outcome.PENDING]
    assert record.exit_code() == NO_GO


def test_retry_asks_only_failed_items_and_keeps_their_history(tmp_path):
    made = checklist([{"ask": "A"}, {"ask": "B"}], [{"ask": "C"}])
    record = record_of(made)
    interface = run_session(made, record, tmp_path, Operator({"A": [FAIL, PASS]}, again=1))
    assert interface.asked == ["A", "B", "A", "C"]
    assert record.exit_code() == GO
    (before,) = record.entries[0].history
    assert "FAIL by Ann: cracked" in before


def test_repeated_item_reads_the_device_again(tmp_path):
    values = iter([5.0, 1.0])
    made = checklist([{"check": "test.it", "max": 2}])
    with registered("test.it", lambda context: Reading(next(values))):
        record = record_of(made)
        run_session(made, record, tmp_path, Operator(again=1))
    assert record.entries[0].value == 1.0
    assert "FAIL" in record.entries[0].history[0]


def test_back_repeats_the_previous_question(tmp_path):
    made = checklist([{"ask": "A"}, {"check": "test.it"}, {"ask": "B"}])
    with registered("test.it", lambda context: Reading(1)):
        record = record_of(made)
        interface = run_session(made, record, tmp_path, Operator({"A": [PASS, SKIP], "B": [BACK, PASS]}))
    assert interface.asked == ["A", "B", "A", "B"]
    assert record.entries[0].outcome is Outcome.SKIPPED
    assert "PASS by Ann" in record.entries[0].history[0]


def test_back_at_the_first_question_repeats_it(tmp_path):
    made = checklist([{"ask": "A"}])
    record = record_of(made)
    assert run_session(made, record, tmp_path, Operator({"A": [BACK, BACK, PASS]})).asked == ["A", "A", "A"]
    assert record.exit_code() == GO


@pytest.mark.parametrize("end", [KeyboardInterrupt, EOFError])
@pytest.mark.parametrize("at", ["A", "B", "C"])
def test_interrupted_record_can_be_resumed(end, at, tmp_path):
    made = checklist([{"check": "test.it"}, {"ask": "A"}, {"ask": "B"}], [{"ask": "C"}])
    reads = []
    with registered("test.it", lambda context: Reading(len(reads)) if not reads.append(1) else Reading()):
        with pytest.raises(end):
            run_session(made, record_of(made), tmp_path, Operator({at: [end]}))
        saved = records.read(tmp_path / "record.json")
        assert saved.state == "incomplete"
        answered = ["A", "B", "C"].index(at)
        assert [e.outcome for e in saved.entries if e.kind == "manual"][:answered] == [Outcome.PASS] * answered
        interface = run_session(made, saved, tmp_path, who="Bob")
    assert interface.asked == ["A", "B", "C"][answered:]
    assert len(reads) == 2  # the automatic item ran again
    assert [e.operator for e in saved.entries if e.kind == "manual"] == ["Ann"] * answered + ["Bob"] * (3 - answered)
    assert [s["operator"] for s in saved.sessions] == ["Ann", "Bob"]
    assert saved.exit_code() == GO


def test_resuming_repeats_failed_and_unknown_items(tmp_path):
    made = checklist([{"ask": "A"}, {"ask": "B"}])
    record = record_of(made)
    run_session(made, record, tmp_path, Operator({"A": [FAIL]}))
    assert run_session(made, record, tmp_path).asked == ["A"]
    assert "FAIL" in record.entries[0].history[0]


def test_the_record_is_on_disk_before_the_first_item_runs(tmp_path):
    seen = []

    def read_back(context):
        seen.append(records.read(tmp_path / "record.json"))
        return Reading(1)

    made = checklist([{"check": "test.it"}])
    with registered("test.it", read_back):
        run_session(made, record_of(made), tmp_path)
    assert seen[0].state == "incomplete"
    assert seen[0].entries[0].outcome is Outcome.PENDING
