from datetime import UTC, datetime, timedelta

import pytest

from hil.check import moment
from hil.check.moment import Moment

UTC_0 = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)


def test_time_between_two_moments_of_one_start_is_that_of_the_clock_that_cannot_be_set():
    now = Moment(UTC_0 - timedelta(days=1), "boot", 70_000_000_000)
    assert now.seconds_since(UTC_0, "boot", 10_000_000_000) == pytest.approx(60.0)


@pytest.mark.parametrize(("boot", "before"), [("boot", "another"), ("", ""), ("boot", "")])
def test_without_a_common_start_the_date_is_used(boot, before):
    now = Moment(UTC_0 + timedelta(seconds=5), boot, 70_000_000_000)
    assert now.seconds_since(UTC_0, before, 10_000_000_000) == pytest.approx(5.0)


def test_clock_goes_on_and_names_the_start_of_this_computer():
    first, second = Moment.now(), Moment.now()
    assert first.boot == second.boot
    assert first.boot == "" or second.uptime_ns > first.uptime_ns > 0


def test_system_without_a_boot_id_has_the_date_only(monkeypatch, tmp_path):
    monkeypatch.setattr(moment, "_BOOT_ID", tmp_path / "none")
    assert (Moment.now().boot, Moment.now().uptime_ns) == ("", 0)
