"""Workers, each with one job at a time."""

from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool

from toposeam_cli.jobs.workers import Answer, Task, Workers


class Executor:
    """Takes a job, or is found dead."""

    def __init__(self, dead=False):
        self.dead, self.future = dead, Future()

    def submit(self, function, task):
        if self.dead:
            raise BrokenProcessPool
        return self.future


class Two(Workers):
    """Two executors, of which the first has died unnoticed."""

    def __init__(self):
        super().__init__(2)
        self.free, self.given_back = [Executor(), Executor(dead=True)], []

    @property
    def is_free(self):
        return bool(self.free)

    def _take(self):
        return self.free.pop()

    def _give_back(self, executor, died):
        self.given_back.append((executor.dead, died))


def test_a_worker_that_died_idle_is_returned_as_dead():
    workers = Two()
    living = workers.free[0]
    workers.begin("job", Task(function="module:function", arguments={}, own={}, resumed=False))
    assert workers.given_back == [(True, True)]
    done = Answer(True, 0.0)
    living.future.set_result(done)
    assert workers.ended(1.0) == [("job", done)]
    assert workers.given_back[1:] == [(False, False)]


def test_a_job_whose_worker_died_has_no_answer():
    workers = Two()
    living = workers.free[0]
    workers.begin("job", Task(function="module:function", arguments={}, own={}, resumed=False))
    living.future.set_exception(BrokenProcessPool())
    assert workers.ended(1.0) == [("job", None)]
    assert workers.given_back[1:] == [(False, True)]
