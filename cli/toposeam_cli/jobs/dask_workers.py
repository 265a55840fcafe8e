"""Workers of a Dask cluster, local or given by its address."""

from __future__ import annotations

import asyncio
import logging
import sys
import threading
import time
import uuid
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import ExitStack, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from toposeam.errors import MissingPackageError, OptionError
from toposeam_cli.files.interruption import ctrl_c_later, uninterrupted
from toposeam_cli.files.temporary import private_folder
from toposeam_cli.jobs.workers import Workers

#: Settings of a local cluster: no pages, some of which Dask's own switch leaves; no profile of workers a
#: hundred times a second, and a check of their loops once a second instead of fifty times. These take 3 % of
#: the workers' time.
_UNWATCHED: dict[str, Any] = {
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
}
#: Name of the setting that holds the environment of a local cluster's processes.
_SPAWNED = "distributed.nanny.pre-spawn-environ"
#: Delay before workers are asked again after one of them died meanwhile, s.
_AGAIN_S = 0.5
#: Time in which a scheduler must answer, s.
_ANSWER_S = 10
#: Longest wait for the end of a local cluster, or of a client's loop, s.
_CLOSING_S = 10


class DaskWorkers(Workers):
    """The workers of a Dask cluster, through its executor."""

    #: More than for processes: a worker that dies loses its queue too, so that harmless tasks count as tried.
    attempts = 4

    def __init__(self, client: Any, count: int, waiting: int = 0) -> None:
        super().__init__(count)
        self._client, self._most = client, count * (1 + waiting)
        self._executor: Executor = client.get_executor(pure=False)

    @property
    def is_free(self) -> bool:
        """True if a worker has room for another task."""
        return len(self._running) < self._most

    def _take(self) -> Executor:
        return self._executor

    def _give_back(self, executor: Executor, died: bool) -> None:
        pass

    def check(self, look: WorkerCheck) -> None:
        """Refuse workers that would not do the same work on the same files.

        Raises
        ------
        OptionError
        """
        remedy = "install the same there as here, on storage that all of them share"
        for _ in range(self.attempts):
            try:
                answers = self._client.run(look, on_error="return")
            except Exception as error:  # from sending the check, or from the workers
                raise OptionError(
                    f"the Dask workers cannot run TopoSeam ({_first_line(error)}); {remedy}"
                ) from error
            if not any(isinstance(said, OSError) for said in answers.values()):
                break
            time.sleep(_AGAIN_S)  # one was killed meanwhile; another will take its place
        for worker, said in answers.items():
            if isinstance(said, BaseException):
                raise OptionError(
                    f"the Dask worker at {worker} cannot run TopoSeam ({_first_line(said)}); {remedy}"
                )
            if said:
                raise OptionError(f"the Dask worker at {worker} {said}")


@dataclass(frozen=True, slots=True)
class WorkerCheck:
    """A check that a worker has our versions and sees our files, run before there is work."""

    versions: Mapping[str, str]
    #: Size of each file in bytes; the first file holds `secret`.
    files: Mapping[str, int]
    secret: str

    @classmethod
    def at(cls, probe: Path, files: Iterable[Path]) -> WorkerCheck:
        """Make a check of files, and of the file `probe`, which this writes."""
        secret = uuid.uuid4().hex
        probe.write_text(secret)
        sizes = {str(path.absolute()): path.stat().st_size for path in (probe, *files)}
        return cls(versions(), sizes, secret)

    def __call__(self) -> str:
        """Run the check in a worker; return what is wrong, or an empty text."""
        for name, theirs in versions().items():
            if theirs != self.versions[name]:
                return (
                    f"has {name} {theirs}, and {self.versions[name]} is here; results would differ, so "
                    "install the same"
                )
        for number, (path, size) in enumerate(self.files.items()):
            try:
                seen = Path(path).stat().st_size == size
                seen = seen and (number > 0 or Path(path).read_text() == self.secret)
            except OSError:
                seen = False
            if not seen:
                return (
                    f"does not see '{path}'; keep pictures and output on storage that all workers share, "
                    "under the same names"
                )
        return ""


def versions() -> dict[str, str]:
    """Return the versions on which the last bits of results depend."""
    from importlib.metadata import version

    found = {name: version(name) for name in ("toposeam", "numpy", "scipy")}
    return {"Python": ".".join(map(str, sys.version_info[:2])), **found}


@contextmanager
def dask_workers(address: str, count: int, waiting: int = 0) -> Iterator[Workers]:
    """Connect to the Dask cluster at an address; for ``local`` make a private one of `count` processes for
    the block. Up to `waiting` further jobs are queued per worker.

    Raises
    ------
    MissingPackageError
        Without ``distributed``, or without ``cryptography`` for a local cluster.
    OptionError
        If there is no cluster at the address.
    """
    try:
        import dask
        import distributed  # noqa: F401 - whether it is there
    except ImportError as error:
        raise MissingPackageError(
            "running on Dask needs distributed; install it with: pip install distributed cryptography"
        ) from error
    # We, not Dask, repeat the job of a worker that died: only we know which files it may have left. Dask has
    # its workers give memory back at every chance and take it anew, which costs more than the work.
    spawned = {name: value for name, value in dask.config.get(_SPAWNED).items() if "MALLOC" not in name}
    settings = {"distributed.scheduler.allowed-failures": 0, _SPAWNED: spawned, **_UNWATCHED}
    with ExitStack() as opened:
        if address == "local":
            # Workers read spilled data back from there, and import from there. The default is a folder in
            # /tmp that anyone may have made before us, and that stays.
            folder = opened.enter_context(private_folder())
            settings["temporary-directory"] = str(folder)
        opened.enter_context(dask.config.set(settings))
        cluster = _local_cluster(count, folder) if address == "local" else None
        try:
            with _client_of(cluster, address) as client:
                threads = sum(client.nthreads().values())
                if not threads:
                    raise OptionError(
                        f"the Dask scheduler at {address!r} has no workers; start some with: dask worker "
                        f"{address}"
                    )
                if client.scheduler.address.startswith("tcp://"):
                    logging.getLogger(__name__).warning(
                        "%s does not use TLS: whoever reaches it can run programs there as you. Use a tls:// "
                        "address outside of networks you trust.",
                        client.scheduler.address,
                    )
                yield DaskWorkers(client, threads, waiting)
        finally:
            _close(cluster)


@contextmanager
def _client_of(cluster: Any, address: str) -> Iterator[Any]:
    """Open a client of our own cluster, or of the scheduler at an address."""
    from distributed import Client

    with _running_loop() if cluster is None else nullcontext() as loop:  # a cluster has one
        client = Client.__new__(Client)
        try:
            Client.__init__(client, cluster or address, timeout=_ANSWER_S, set_as_default=False, loop=loop)
        except (OSError, ValueError, TypeError, TimeoutError) as error:
            with suppress(Exception):  # else it does so when it is collected, wherever that is
                client.close()
            raise OptionError(
                f"there is no Dask scheduler at {address!r} that lets us in ({_first_line(error)}); "
                "start one, or give its address (and its certificates in Dask's configuration, if it "
                "uses TLS), or use --dask local"
            ) from error
        with client:
            yield client


@contextmanager
def _running_loop() -> Iterator[Any]:
    """Run an event loop for a client in a thread that ends with the block, where Dask's own goes on
    afterwards.
    """
    from tornado.ioloop import IOLoop

    begun: SimpleQueue[tuple[Any, asyncio.Event]] = SimpleQueue()

    async def run() -> None:
        end = asyncio.Event()
        begun.put((IOLoop.current(), end))
        await end.wait()

    thread = threading.Thread(target=lambda: asyncio.run(run()), daemon=True)
    thread.start()
    loop, end = begun.get()
    try:
        yield loop
    finally:
        loop.add_callback(end.set)
        thread.join(_CLOSING_S)


def _local_cluster(count: int, folder: Path) -> Any:
    """Start a Dask cluster of processes that use TLS with a new key and certificate. Without these, anyone
    who can connect to this machine's ports could run programs as this user.
    """
    from distributed import LocalCluster

    security = _security(folder)
    _silence()
    cluster = None
    try:
        with ctrl_c_later():
            cluster = LocalCluster(
                n_workers=count,
                threads_per_worker=1,
                security=security,
                host="127.0.0.1",
                dashboard_address=None,
                scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},
                silence_logs=logging.CRITICAL,
            )
            cluster.shutdown_on_close = False  # we close it; at exit Dask would print what fails then
    except Exception as error:  # Dask raises various errors when its processes end while they start
        raise OptionError(
            f"the local Dask cluster does not start ({_first_line(error)}); run the same again, or without "
            "--dask"
        ) from error
    except BaseException:  # an interruption that came meanwhile
        _close(cluster)
        raise
    return cluster


def _security(folder: Path) -> Any:
    """Make a key and a certificate for TLS, as files in a private folder.

    Given as texts instead, each process would write them to a temporary folder of its own for a moment, and
    would leave that folder if it were killed then.
    """
    from distributed.security import Security

    try:
        made = Security.temporary()
    except ImportError as error:
        raise MissingPackageError(
            "a Dask cluster that nobody else can use needs cryptography; install it with: pip install "
            "cryptography"
        ) from error
    key, certificate = folder / "dask.pem", folder / "dask.crt"
    key.touch(mode=0o600)
    key.write_text(made.tls_client_key)
    certificate.write_text(made.tls_client_cert)
    by_role = {
        f"tls_{role}_{part}": str(path)
        for role in ("client", "scheduler", "worker")
        for part, path in (("key", key), ("cert", certificate))
    }
    return Security(require_encryption=True, tls_ca_file=str(certificate), **by_role)


def _close(cluster: Any) -> None:
    """Close a cluster's processes, silently where the same signal has ended them already."""
    if cluster is not None:
        with uninterrupted(), suppress(Exception):
            cluster.close(timeout=_CLOSING_S)


def _is_critical(record: logging.LogRecord) -> bool:
    return record.levelno >= logging.CRITICAL


def _silence() -> None:
    """Suppress Dask's messages about closed connections. It prints them with tracebacks, even after the
    cluster is closed, when its own setting for silence has ended.
    """
    for handler in logging.getLogger("distributed").handlers:
        handler.addFilter(_is_critical)


def _first_line(error: BaseException) -> str:
    lines = str(error).strip().splitlines()
    return lines[0] if lines else type(error).__name__
