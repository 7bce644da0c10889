"""The load of the machine: shares between two samples, and zero where the kernel reports nothing."""

import pytest

from hil.live.load import Load, load_line, load_now, load_table, sleep


def test_load_shares_are_of_the_time_between_two_samples():
    table = load_table(Load(0.5, 1000, 10, 5000), Load(2.0, 1400, 110, 6000))
    assert (table["idle"], table["stolen"], table["load_average"]) == (0.4, 0.1, (0.5, 2.0))
    assert "40% idle, load average 0.5 before, 2.0 after; 10% of their time went to other guests" in load_line(table)
    assert "guests" not in load_line({**table, "stolen": 0.004})


def test_load_is_what_the_kernel_reports(tmp_path):
    stat = tmp_path / "stat"
    stat.write_text("cpu  10 1 5 100 20 0 2 7 3 0\ncpu0 1 1 1 1 1 1 1 1 1 1\n")
    assert load_now(stat)[1:] == (120, 7, 145)  # a guest's time is counted in the first column already


@pytest.mark.parametrize("text", [None, "", "cpu  1 2", "cpu  a b c d e f g h"])
def test_load_is_zero_where_the_kernel_reports_nothing(tmp_path, text):
    stat = tmp_path / "stat"
    if text is not None:
        stat.write_text(text)
    assert load_now(stat)[1:] == (0, 0, 0)
    table = load_table(load_now(stat), load_now(stat))
    assert (table["idle"], table["stolen"]) == (0.0, 0.0)


@pytest.mark.parametrize(("took", "said"), [(0.05, ""), (0.14, ""), (0.36, "this computer stood still for 0.31 s")])
def test_sleep_tells_that_the_computer_stood_still(took, said):
    slept, times = [], iter((10.0, 10.0 + took))
    text = sleep(0.05, slept.append, lambda: next(times))
    assert slept == [0.05]
    assert text.startswith(said) and bool(text) == bool(said)
