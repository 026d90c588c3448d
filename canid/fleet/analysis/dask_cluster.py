"""The connection to a Dask cluster: a scheduler's address, or workers that are started on this machine."""

from __future__ import annotations

import logging
import time
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager, suppress
from types import ModuleType
from typing import Any

from canid.fleet.analysis import dask_worker
from canid.fleet.analysis.key import PROGRAM
from canid.values.errors import CanidError, ConfigError, one_line

# s that an attempt to connect may take: within a data centre it takes milliseconds
CONNECT_S = 5.0
# s between two attempts
RETRY_S = 0.5
# s that closing may take: what runs is given up
CLOSE_S = 5.0
# evaluated by every process of the cluster: nothing of canid has to be there to ask for it
_PROGRAM_OF = "(lambda key: getattr(key, 'PROGRAM', key.IDENTITY))(__import__('canid.fleet.analysis.key', fromlist=['key']))"

# of processes that are started here: with Dask's defaults a worker that waits takes 4 % of a core, with these 1 %
_IDLE = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "5s",
}

_LOGGING = ("distributed", "tornado", "asyncio")

Inform = Callable[[str], None]


class SchedulerLostError(CanidError):
    """The scheduler does not answer."""


def distributed() -> ModuleType:
    """The package. Raises ConfigError where it is missing."""
    try:
        import distributed as package
    except ImportError as error:
        raise ConfigError("fleet: --scheduler needs distributed: pip install 'canid[fleet]'") from error
    return package


@contextmanager
def quiet() -> Iterator[None]:
    """Keep what Dask logs and warns of out of the user's terminal: canid says itself what the user can do."""
    import dask

    # Dask gives some of its loggers a level of their own: that of the packages alone silences too few
    names = {"distributed", "tornado", "asyncio", *logging.root.manager.loggerDict}
    loggers = [logging.getLogger(name) for name in names if name.partition(".")[0] in _LOGGING]
    levels = [logger.level for logger in loggers]
    for package in ("distributed", "dask", "tornado"):
        warnings.filterwarnings("ignore", module=rf"{package}(\.|$)")
    for logger in loggers:
        logger.setLevel(logging.CRITICAL + 1)
    try:
        with dask.config.set({"distributed.comm.timeouts.connect": f"{CONNECT_S}s", **_IDLE}):
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


@contextmanager
def local_cluster(workers: int) -> Iterator[str]:
    """Start a scheduler and workers on this machine; its address. All ends with the context."""
    try:
        cluster = distributed().LocalCluster(
            # one process whose threads wait for their children: a process for each thread costs its start and 3 % of a core
            n_workers=1,
            threads_per_worker=workers,
            host="127.0.0.1",
            dashboard_address=None,
            # a worker holds next to nothing: its child has a limit of its own
            memory_limit=0,
            silence_logs=logging.CRITICAL + 1,
        )
    except (RuntimeError, OSError) as error:
        # from a script without `if __name__ == "__main__":` a process cannot be started in this way
        why = one_line(error.__cause__ or error)
        raise CanidError(f"fleet: Dask's workers cannot be started on this machine ({why})") from None
    try:
        yield str(cluster.scheduler_address)
    finally:
        with suppress(Exception):  # whatever is left is ended with this process
            cluster.close(timeout=CLOSE_S)


def connected(address: str, patience_s: float) -> Any:
    """A client of a scheduler.

    Args:
        address: such as "tcp://host:8786".
        patience_s: s that it may take until it answers.

    Raises:
        ConfigError: it is no address.
        SchedulerLostError: nothing answers.
    """
    deadline = time.monotonic() + patience_s
    while True:
        left = deadline - time.monotonic()
        try:
            return distributed().Client(
                address, timeout=max(min(left, CONNECT_S), RETRY_S), set_as_default=False, name="canid-fleet"
            )
        except ValueError as error:
            raise ConfigError(f"fleet: --scheduler {address}: {one_line(error)}") from None
        except (OSError, TimeoutError):  # nobody listens, or it does not answer
            if time.monotonic() + RETRY_S >= deadline:
                raise SchedulerLostError(f"no Dask scheduler answers at {address}") from None
            time.sleep(RETRY_S)


def threads(client: Any) -> dict[str, int]:
    """How many tasks each worker runs at a time. Raises SchedulerLostError."""
    try:
        return dict(client.nthreads())
    except Exception as error:  # a lost connection has many names
        raise SchedulerLostError(f"the Dask scheduler does not answer ({one_line(error)})") from None


def ended(client: Any, address: str) -> int | None:
    """How many tasks a worker that has ended left undone; None: it was retired, or not known. Raises SchedulerLostError."""
    try:
        events = client.get_events("all")
    except Exception as error:  # a lost connection has many names
        raise SchedulerLostError(f"the Dask scheduler does not answer ({one_line(error)})") from None
    for _, event in reversed(events or ()):
        if event.get("action") == "remove-worker" and event.get("worker") == address:
            return None if event.get("expected") else len(event.get("processing-tasks") or ())
    return None


def await_workers(
    client: Any, address: str, patience_s: float, inform: Inform, blind: Collection[str] = ()
) -> dict[str, int]:
    """Wait until there is a worker; returns how many tasks each runs at a time.

    Args:
        client: of the scheduler.
        address: of the scheduler.
        patience_s: s that is waited.
        inform: takes a line for the user.
        blind: addresses of workers that do not count.

    Raises:
        ConfigError: there is none, or one cannot run this canid.
        SchedulerLostError: the scheduler does not answer.
    """
    deadline = time.monotonic() + patience_s
    said = False
    none = "has no worker that sees the logs" if blind else "has no worker"
    while not (seeing := {worker: n for worker, n in threads(client).items() if worker not in blind}):
        if time.monotonic() >= deadline:
            remedy = (
                "mount them there under the same paths"
                if blind
                else f"start some with `dask worker {address}`"
            )
            raise ConfigError(f"fleet: {address} {none}: {remedy}")
        if not said:
            said = True
            inform(f"{address} {none}; waiting {patience_s:g} s for one (`dask worker {address}`)")
        time.sleep(RETRY_S)
    check_versions(client)
    return seeing


def check_versions(client: Any) -> None:
    """Raise ConfigError where a process of the cluster has no canid, or another version of it or of Python."""
    try:
        answers = dict(client.run(eval, _PROGRAM_OF, on_error="return"))
        answers["scheduler"] = client.run_on_scheduler(eval, _PROGRAM_OF)
    except ImportError as error:
        answers = {"scheduler": error}
    except Exception as error:  # a lost connection has many names
        raise SchedulerLostError(f"the Dask scheduler does not answer ({one_line(error)})") from None
    for where, answer in answers.items():
        if isinstance(answer, ImportError):
            raise ConfigError(no_canid(where, answer))
        if isinstance(answer, str) and answer != PROGRAM:
            raise ConfigError(f"fleet: {dask_worker.other_version(answer, PROGRAM)}")


def no_canid(where: str, error: BaseException) -> str:
    """The line for a process that cannot import canid."""
    process = "the Dask scheduler" if where == "scheduler" else f"the Dask worker {where}".rstrip()
    return (
        f"fleet: {process} cannot import canid ({one_line(error)}): install canid[fleet] in its environment"
    )
