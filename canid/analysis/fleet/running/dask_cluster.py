"""The connection to a Dask cluster, by the address of its scheduler."""

from __future__ import annotations

import ipaddress
import logging
import time
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from types import ModuleType
from typing import Any
from urllib.parse import urlsplit

from canid.analysis.fleet.key import PROGRAM
from canid.analysis.fleet.running import dask_worker
from canid.values.errors import CanidError, ConfigError, one_line

# s that an attempt to connect may take: within a data centre it takes milliseconds
CONNECT_S = 5.0
# s between two attempts
RETRY_S = 0.5
# s that closing may take: what runs is given up
CLOSE_S = 5.0
# evaluated by every process of the cluster: nothing of canid has to be there to ask for it
_PROGRAM_OF = (
    "(lambda key: getattr(key, 'PROGRAM', key.IDENTITY))"
    "(__import__('canid.analysis.fleet.key', fromlist=['key']))"
)

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
        with dask.config.set({"distributed.comm.timeouts.connect": f"{CONNECT_S}s"}):
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


def exposure(address: str) -> str:
    """What is to be known of a connection that leaves this machine without TLS; "": nothing.

    Example:
        >>> exposure("tls://node1:8786"), exposure("tcp://127.0.0.1:8786"), exposure("tcp://[::1]:8786")
        ('', '', '')
        >>> exposure("node1:8786").partition(":")[0]
        'node1'
    """
    protocol, separator, rest = address.partition("://")
    if protocol == "tls" or _is_loopback(rest if separator else address):
        return ""
    return (
        f"{address}: neither encrypted nor authenticated: whoever reaches the scheduler or a worker runs code as you; "
        "tls:// and a certificate: docs/clusters.md"
    )


def _is_loopback(place: str) -> bool:
    """Of "host:port"."""
    try:
        host = urlsplit(f"//{place}").hostname or ""
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def connected(address: str, patience_s: float) -> Any:
    """A client of a scheduler; of one with TLS, with the certificate that Dask's configuration names.

    Args:
        address: such as "tls://host:8786".
        patience_s: s that it may take until it answers.

    Raises:
        ConfigError: it is no address, or its certificate and that of the configuration do not match.
        SchedulerLostError: nothing answers.
    """
    from distributed.comm.core import FatalCommClosedError

    deadline = time.monotonic() + patience_s
    security = _security(address)
    while True:
        left = deadline - time.monotonic()
        try:
            return distributed().Client(
                address,
                security=security,
                timeout=max(min(left, CONNECT_S), RETRY_S),
                set_as_default=False,
                name="canid-fleet",
            )
        except ValueError as error:
            raise ConfigError(f"fleet: --scheduler {address}: {one_line(error)}") from None
        except FatalCommClosedError:
            raise ConfigError(
                f"fleet: --scheduler {address}: its certificate is none that Dask's configuration here names "
                "(distributed.comm.tls; docs/clusters.md)"
            ) from None
        except (OSError, TimeoutError):  # nobody listens, or it does not answer
            if time.monotonic() + RETRY_S >= deadline:
                raise SchedulerLostError(f"no Dask scheduler answers at {address}") from None
            time.sleep(RETRY_S)


def _security(address: str) -> Any:
    """The certificates of Dask's configuration. Raises ConfigError where they cannot serve for an address."""
    if not address:  # Dask would start a cluster of its own
        raise ConfigError("fleet: --scheduler: is empty; an address is such as tls://host:8786")
    where = f"fleet: --scheduler {address}"
    try:
        security = distributed().Security()
        given = security.get_connection_args("client")
    except Exception as error:  # a file that is missing, is not readable, or is no certificate
        raise ConfigError(
            f"{where}: the certificate for clients in Dask's configuration cannot be used ({one_line(error)}): "
            "distributed.comm.tls, docs/clusters.md"
        ) from None
    if address.startswith("tls://") and given.get("ssl_context") is None:
        raise ConfigError(
            f"{where}: Dask's configuration here names no certificate for clients: distributed.comm.tls, docs/clusters.md"
        )
    if given.get("require_encryption") and not address.startswith("tls://"):
        raise ConfigError(f"{where}: Dask's configuration here requires encryption: tls://")
    return security


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
