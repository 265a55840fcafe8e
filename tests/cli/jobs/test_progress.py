"""How far a run is, and how long it will take."""

import time

import pytest

from toposeam_cli.jobs.runner import Job, Outcome, _Tally


def test_the_time_left_comes_from_the_work_that_is_done(monkeypatch):
    now = 0.0
    monkeypatch.setattr(time, "monotonic", lambda: now)
    jobs = [Job(f"{index}", "m:f", {}, weight=weight) for index, weight in enumerate((4, 4, 1, 1, 1, 1))]
    reports = []
    tally = _Tally(jobs, reports.append)
    tally.begin(jobs[0])
    tally.begin(jobs[1])
    now = 4.0
    tally.end(Outcome(jobs[0], "done", 4.0))
    tally.begin(jobs[2])
    now = 4.5
    tally.report()  # two at a time: half of job 2 is left, jobs 3 to 5 wait, and job 1 is about to end
    assert (reports[-1].share, reports[-1].remaining_s) == pytest.approx((4 / 12, (0.5 + 3) / 2))
    tally.end(Outcome(jobs[1], "failed", 0.1, "what fails at once says nothing of the others"))
    tally.end(Outcome(jobs[2], "done", 1.0))
    for job in jobs[3:5]:
        tally.end(Outcome(job, "skipped", 9.0))
    tally.begin(jobs[5])
    tally.report()
    assert (reports[-1].share, reports[-1].remaining_s) == pytest.approx((11 / 12, 1.0))
