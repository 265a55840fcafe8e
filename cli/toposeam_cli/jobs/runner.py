"""Many jobs on several processes: none is lost, none stops the others, and an interrupted run goes on where
it ended.

A job names a function of a module that workers can import, its arguments as JSON knows them, and the files it
reads and makes::

    jobs = [
        Job("one", "pages:draw", {"seed": 1, "output": "one.png"}, outputs=(Path("one.png"),)),
        Job("two", "pages:draw", {"seed": 2, "output": "two.png"}, outputs=(Path("two.png"),)),
    ]
    for outcome in run(jobs, processes=2, journal=Path("book.jsonl")):
        print(outcome.job.name, outcome.status, outcome.message, outcome.result)

The function writes its outputs itself, with :func:`toposeam_cli.files.writing.atomic_write` or
:func:`toposeam_cli.media.pictures.picture.write_picture`, so that they appear complete or not at all.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from toposeam.errors import OptionError
from toposeam_cli.files.regular import real_path
from toposeam_cli.files.temporary import remove_stale
from toposeam_cli.jobs.dask_workers import dask_workers
from toposeam_cli.jobs.journal import Journal, Row
from toposeam_cli.jobs.workers import Answer, Task, worker_processes

#: Interval between reports of progress while no job ends, s.
_REPORT_EVERY_S = 1.0

Status = Literal["done", "failed", "skipped"]


@dataclass(frozen=True, slots=True, eq=False)
class Job:
    """A piece of work."""

    #: Unique in the run.
    name: str
    #: ``module:callable``, importable in a worker. It returns a value that JSON can hold.
    function: str
    #: Keyword arguments, values that JSON can hold; paths as texts.
    arguments: Mapping[str, Any]
    #: Every file it makes.
    outputs: tuple[Path, ...] = ()
    #: Files it reads: when one of them has changed, the job is done again.
    inputs: tuple[Path, ...] = ()
    #: Further arguments that do not change the outputs, such as whether files may be replaced. They are left
    #: out of the digest.
    manner: Mapping[str, Any] = field(default_factory=dict)
    #: Whether outputs of a former run, known by their digests in the journal, may be replaced without force.
    remakes: bool = False
    #: Work relative to the other jobs, for the estimate of time.
    weight: float = 1.0

    @property
    def key(self) -> str:
        """Digest of the function, its arguments, and the size and time of every input."""
        work = [
            self.function,
            self.arguments,
            [[str(path.absolute()), *_state(path)] for path in self.inputs],
        ]
        return hashlib.sha256(json.dumps(work, sort_keys=True).encode()).hexdigest()[:32]


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """Outcome of a job."""

    job: Job
    #: "skipped" if the journal shows that an earlier run did it.
    status: Status
    #: Duration, s; that of the earlier run if skipped.
    seconds: float
    #: Why it failed, one sentence; else "".
    message: str = ""
    #: The value that the function returned.
    result: Any = None


@dataclass(frozen=True, slots=True)
class Progress:
    """Progress of a run."""

    #: Jobs that are done, skipped or failed, and all jobs.
    finished: int
    total: int
    failed: int
    #: Share of the work that is finished, by weight, in [0, 1].
    share: float
    #: s; None before the first job is done.
    remaining_s: float | None


def run(
    jobs: Sequence[Job],
    *,
    processes: int = 1,
    dask: str | None = None,
    journal: Path | None = None,
    resume: bool = True,
    progress: Callable[[Progress], None] | None = None,
) -> Iterator[Outcome]:
    """Run jobs, and yield the outcome of each as soon as it has ended.

    - A job that fails leaves no new file and stops no other job. When a worker process dies (killed, out of
      memory), the job it had is tried once more in a new process (on Dask up to three times more), then
      counts as failed.
    - With a journal, a job that a former run has done is skipped if its function, its arguments and its
    inputs are unchanged and all its outputs exist. A job that was interrupted is done again. - No file that
    has its final name is ever removed. Unfinished files have names that only we use. If a run ended after
    outputs got their names but before the journal had their row, the second try accepts outputs that are
    equal byte for byte; any other file belongs to the user. - Outputs do not depend on the number of
    processes: every worker's libraries use one thread. - Leaving the iterator early, as Ctrl-C does, ends the
    workers; the journal is complete at any moment.

    Call it under ``if __name__ == "__main__"`` in a script: workers import the script they were started from.

    Parameters
    ----------
    jobs : sequence of Job
    processes : int
        Workers, each with one job at a time.
    dask : str, optional
        Address of a Dask scheduler whose workers do the jobs instead; ``"local"`` makes a cluster of
        `processes` workers. They have to see the same files under the same names.
    journal : Path, optional
        File of JSON lines, one row a job: name, status, seconds, message, result, outputs and the digest. In
        the order of `jobs` when all have ended.
    resume : bool
        Whether to skip jobs that are done; False does every job again.
    progress : callable, optional
        Called after each job, and every second.

    Yields
    ------
    Outcome
        First the skipped jobs, then the others in the order in which they end.

    Raises
    ------
    OptionError
        Before any work: if two jobs share their name or an output, or one reads what another makes; if the
        journal cannot be used, or there is no such cluster.
    MissingPackageError
        For `dask` without ``distributed``.
    """
    check(jobs)
    if processes < 1:
        raise OptionError(f"{processes} processes cannot do anything; use at least 1")
    return _run(tuple(jobs), processes, dask, journal, resume, progress)


def check(jobs: Sequence[Job]) -> None:
    """Refuse jobs that would disturb each other.

    Raises
    ------
    OptionError
    """
    names: set[str] = set()
    makers: dict[Path, str] = {}
    for job in jobs:
        if job.name in names:
            raise OptionError(f"two jobs are called {job.name!r}; give each a name of its own")
        names.add(job.name)
        for path in {real_path(path) for path in job.outputs}:
            if path in makers:
                raise OptionError(
                    f"the jobs {makers[path]!r} and {job.name!r} both write '{path}'; give each an output of "
                    "its own"
                )
            makers[path] = job.name
    for job in jobs:
        for path in job.inputs:
            maker = makers.get(real_path(path))
            if maker is not None:
                how = "itself writes" if maker == job.name else f"{maker!r} writes"
                raise OptionError(
                    f"the job {job.name!r} reads '{path}', which {how}; choose another output, or run them "
                    "one after the other"
                )


def finished(job: Job, row: Mapping[str, Any] | None) -> bool:
    """Test whether a row of the journal shows that the job is done."""
    return (
        row is not None
        and row["status"] == "done"
        and row.get("key") == job.key
        and all(path.exists() for path in job.outputs)
    )


def _run(
    jobs: tuple[Job, ...],
    processes: int,
    dask: str | None,
    journal: Path | None,
    resume: bool,
    progress: Callable[[Progress], None] | None,
) -> Iterator[Outcome]:
    with ExitStack() as stack:
        table = None if journal is None else stack.enter_context(Journal(journal))
        _tidy(*jobs)
        stack.callback(_tidy, *jobs)  # again when the workers are gone, however they ended
        tally = _Tally(jobs, progress)
        waiting: deque[Job] = deque()
        outcomes: list[Outcome] = []
        for job in jobs:
            row = None if table is None else table.rows.get(job.name)
            if resume and row is not None and finished(job, row):
                outcomes.append(Outcome(job, "skipped", row.get("seconds", 0.0), result=row.get("result")))
                tally.end(outcomes[-1])
            else:
                waiting.append(job)
        tally.report()
        if waiting:
            count = min(processes, len(waiting))
            workers = stack.enter_context(
                worker_processes(count) if dask is None else dask_workers(dask, count)
            )
        begun: dict[str, tuple[Job, Row]] = {}
        deaths: Counter[str] = Counter()
        while waiting or begun:
            while waiting and workers.is_free:
                job = waiting.popleft()
                former = None if table is None else table.rows.get(job.name)
                begun[job.name] = job, _started(job, former)
                if table is not None:
                    table.add(begun[job.name][1])
                tally.begin(job)
                workers.begin(
                    job.name,
                    Task(
                        job.function,
                        {**job.arguments, **job.manner},
                        own=begun[job.name][1]["made"] if job.remakes else {},
                        resumed=deaths[job.name] > 0 or (former is not None and former["status"] != "done"),
                    ),
                )
            yield from outcomes  # now that the workers are busy again
            outcomes = []
            for name, said in workers.ended(_REPORT_EVERY_S):
                job, row = begun.pop(name)
                answer: Answer | None = said
                if answer is None:
                    _tidy(job)
                    deaths[name] += 1
                    if deaths[name] < workers.attempts:
                        waiting.appendleft(job)
                        continue
                outcomes.append(_outcome(job, answer))
                if table is not None:
                    table.add(_ended(outcomes[-1], row, answer))
                tally.end(outcomes[-1])
            tally.report()
        yield from outcomes
        if table is not None:
            table.tidy(job.name for job in jobs)


def _outcome(job: Job, answer: Answer | None) -> Outcome:
    if answer is None:
        message = (
            "its worker process died every time, as it does when memory runs out; run fewer at once "
            "(-j), or use smaller pictures"
        )
        return Outcome(job, "failed", 0.0, message)
    return Outcome(
        job,
        "done" if answer.succeeded else "failed",
        round(answer.seconds, 6),
        answer.message,
        json.loads(answer.result),
    )


def _started(job: Job, former: Row | None) -> Row:
    made = {} if former is None else former.get("made", {})
    return {"name": job.name, "status": "started", "key": job.key, "made": made}


def _ended(outcome: Outcome, started: Row, answer: Answer | None) -> Row:
    return {
        "name": outcome.job.name,
        "status": outcome.status,
        "seconds": outcome.seconds,
        "message": outcome.message,
        "result": outcome.result,
        "outputs": [str(path) for path in outcome.job.outputs],
        "key": started["key"],
        "made": started["made"] | (answer.made if answer is not None else {}),
    }


def _tidy(*jobs: Job) -> None:
    """Remove unfinished files that dead workers left in the folders of the jobs' outputs."""
    for folder in {real_path(path).parent for job in jobs for path in job.outputs}:
        remove_stale(folder)


def _state(path: Path) -> tuple[int, int] | tuple[()]:
    """Size and time of a file; nothing if there is none."""
    try:
        state = path.stat()
    except (OSError, ValueError):
        return ()
    return state.st_size, state.st_mtime_ns


class _Tally:
    """Progress of a run, and estimate of the time left."""

    def __init__(self, jobs: Sequence[Job], report: Callable[[Progress], None] | None) -> None:
        self._report = report
        self._total = len(jobs)
        self._waiting = {job.name: job.weight for job in jobs}
        self._begun: dict[str, tuple[float, float]] = {}
        self._work = sum(self._waiting.values())
        self._most = 1  # jobs at a time
        self._finished = self._failed = 0
        self._seconds = self._weight = 0.0

    def begin(self, job: Job) -> None:
        self._waiting.pop(job.name, None)
        self._begun[job.name] = job.weight, time.monotonic()
        self._most = max(self._most, len(self._begun))

    def end(self, outcome: Outcome) -> None:
        self._waiting.pop(outcome.job.name, None)
        self._begun.pop(outcome.job.name, None)
        self._finished += 1
        self._failed += outcome.status == "failed"
        if outcome.status == "done":  # skipped and failed jobs do not count for the pace
            self._seconds += outcome.seconds
            self._weight += outcome.job.weight

    def report(self) -> None:
        if self._report is None:
            return
        left = sum(self._waiting.values()) + sum(weight for weight, _ in self._begun.values())
        share = 1 - left / self._work if self._work else 1.0
        self._report(Progress(self._finished, self._total, self._failed, share, self._remaining_s()))

    def _remaining_s(self) -> float | None:
        if not self._weight:
            return None if self._waiting or self._begun else 0.0
        pace = self._seconds / self._weight
        now = time.monotonic()
        rest = [max(0.0, weight * pace - (now - since)) for weight, since in self._begun.values()]
        return max([(sum(self._waiting.values()) * pace + sum(rest)) / self._most, *rest])
