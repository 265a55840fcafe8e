"""What holds for all tests."""

import signal
from importlib.util import find_spec

import pytest

from toposeam.errors import MissingPackageError

# A shell that starts the tests in the background lets them ignore Ctrl-C, and they would wait for ever for
# what their own signals do.
if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(wrapper=True)
def pytest_collect_file():
    """Examples are in ``core``; looked for in the tests too, they would cost a quarter of the start."""
    return [found for found in (yield) if type(found).__name__ != "DoctestModule"]


#: What needs signals, terminals and limits as Unix has them, for most of its tests.
if find_spec("resource") is None:
    collect_ignore = [
        "mutants.py",
        "cli/batch/test_batch.py",
        "cli/files/test_interruption.py",
        "cli/jobs/test_runner.py",
        "cli/pictures/test_not_written.py",
        "cli/test_ends.py",
        "cli/test_machine_fails.py",
        "cli/test_terminal.py",
    ]


@pytest.fixture
def both_ways(monkeypatch):
    """Results of a call by the kernels, and by NumPy and SciPy; the test is skipped where none were built."""

    def results(call):
        from toposeam import _kernels

        if _kernels.library is None:
            pytest.skip("no kernels were built")
        by_kernels = call()
        with monkeypatch.context() as without:
            without.setattr(_kernels, "library", None)
            return by_kernels, call()

    return results


@pytest.fixture
def hangups_arrive():
    """``nohup`` lets the tests ignore a closed terminal, and with them what they start: not while they send
    that signal themselves.
    """
    if not hasattr(signal, "SIGHUP"):
        yield
        return
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """Skip what wants PyMaxflow where it is not installed: it has no wheels for Python 3.14, ARM and musl."""
    try:
        return (yield)
    except MissingPackageError as error:
        if "PyMaxflow" in str(error) and find_spec("maxflow") is None:
            pytest.skip("PyMaxflow is not installed")
        raise


@pytest.fixture
def dask_cluster():
    """Dask clusters of N processes, on free ports only: Dask's schedulers all try the same one first, and
    where another test's has it they warn, which ends here as an error.
    """
    distributed = pytest.importorskip("distributed")

    def start(count):
        return distributed.LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            host="127.0.0.1",
            dashboard_address=None,
            scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
        )

    return start
