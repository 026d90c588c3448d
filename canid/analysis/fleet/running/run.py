"""A run of a fleet: what the folder knows already is skipped, the rest is analysed, and every outcome stored."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from typing import Any, NamedTuple

from canid.analysis.fleet.job import Failure, Job, Outcome, Settings, Status
from canid.analysis.fleet.key import key
from canid.analysis.fleet.planning import address, listing, same_bytes
from canid.analysis.fleet.planning.plan import Plan, PlannedLog
from canid.analysis.fleet.planning.same_bytes import File
from canid.analysis.fleet.running import storage_wait
from canid.analysis.fleet.running.storage_wait import Runner
from canid.analysis.fleet.storage import consolidated, outcome_rows
from canid.analysis.fleet.storage.held_signals import held
from canid.analysis.fleet.storage.outcome_rows import Known
from canid.analysis.fleet.storage.store import Store
from canid.values.errors import OutputError

NOT_YET = "not analysed yet: the run was interrupted; the same command goes on"


class Progress(NamedTuple):
    """How far a run is."""

    done: int  # logs that were analysed
    total: int  # logs that are to be
    failed: int  # of those that are done
    share: float  # of the bytes that are to be read: the largest logs come first


@dataclass(frozen=True)
class LogRows:
    """The rows of `columns.LOGS`, made anew each time that they are gone through: of a million logs they take 1 GB."""

    plan: Plan
    state: Sequence[Known | None]  # of each log

    def __len__(self) -> int:
        """Logs."""
        return len(self.state)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Row by row."""
        return _rows(self.plan, self.state)


class Run(NamedTuple):
    """What came of a run."""

    logs: LogRows
    analysed: int  # in this run; all others were known, or are copies


def run(
    plan: Plan,
    store: Store,
    settings: Settings,
    runner: Runner,
    *,
    retry_failed: bool = False,
    progress: Callable[[Progress], None] = lambda _: None,
    hashing: Callable[[float], None] = lambda _: None,
    inform: Callable[[str], None] = lambda _: None,
) -> Run:
    """Analyse what is new, and write the tables.

    An interruption (`KeyboardInterrupt`) or an error ends it early: what was finished is stored and in the tables, and the
    exception is raised again.

    Args:
        plan: the logs.
        store: the open folder.
        settings: of the analysis.
        runner: `local_run.outcomes` or `dask_run.outcomes` with all but the jobs bound; it is closed where the run ends
            early, which ends what runs.
        retry_failed: try all logs again that failed, not only those that another attempt may mend.
        progress: is called after every log.
        hashing: is called with the share of the bytes that are compared with those of other logs.
        inform: takes a line for the user, where the storage of logs does not answer.

    Raises:
        OutputError: the folder cannot be written, such as on a full disk.
    """
    computed = outcome_rows.computed(settings)
    state: list[Known | None] = []
    pending: list[int] = []
    for number, planned in enumerate(plan.logs):
        known = _planned(planned) or store.by_identity.get(outcome_rows.identity(planned, computed))
        state.append(known)
        if not planned.failure.value and (known is None or not known.final(retry_failed=retry_failed)):
            pending.append(number)
    analysed = 0
    finished = False
    try:
        keys = _keys(plan, store, pending, settings, hashing)
        pending = _adopted(plan, store, computed, state, pending, keys, retry_failed=retry_failed)
        total = len(pending)
        failed = 0
        size = _bytes(plan, pending)
        read = 0
        progress(Progress(0, total, 0, 0.0))
        while pending:
            first, later = _first_of_each(pending, keys)
            for number, outcome in _outcomes(plan, first, settings, runner, inform):
                with held():
                    state[number] = store.add(plan.logs[number], computed, outcome)
                analysed += 1
                failed += outcome.status is Status.FAILED
                read += _bytes(plan, [number])
                progress(Progress(analysed, total, failed, min(read / size, 1.0)))
            # copies take the results of the first; where those did not come, they are analysed themselves
            pending = _adopted(plan, store, computed, state, later, keys, retry_failed=False)
            total -= len(later) - len(pending)
            size -= _bytes(plan, later) - _bytes(plan, pending)
        finished = True
    finally:
        # after an error, such as of a full disk, as far as it goes: what is in the journal is safe already
        logs = LogRows(plan, state)
        if finished:
            _write(store, logs)
        else:
            with suppress(OutputError):
                _write(store, logs)
    return Run(logs, analysed)


def _bytes(plan: Plan, numbers: Iterable[int]) -> int:
    """Bytes of logs; one at least, where a storage does not state them."""
    return sum(max(plan.logs[number].size, 1) for number in numbers)


def _write(store: Store, logs: LogRows) -> None:
    store.seal()
    consolidated.written(store.folder, logs, store.check)


def _planned(planned: PlannedLog) -> Known | None:
    """The state of a log that cannot be analysed."""
    if not planned.failure.value:
        return None
    return Known("", Status.FAILED, planned.failure, planned.reason, "", 0, planned.size)


def _keys(
    plan: Plan, store: Store, pending: Sequence[int], settings: Settings, hashing: Callable[[float], None]
) -> dict[int, str]:
    """Keys of the pending logs whose bytes another log may have as well."""
    files = [
        File(planned.log, planned.size, number)
        for number in pending
        if not address.scheme_of((planned := plan.logs[number]).log)
    ]
    stored = {known.size for known in store.by_key.values()}
    return {
        number: key(sha256, plan.logs[number].source, settings)
        for number, sha256 in same_bytes.hashes(files, stored, hashing)
    }


def _adopted(
    plan: Plan,
    store: Store,
    computed: str,
    state: list[Known | None],
    pending: Iterable[int],
    keys: Mapping[int, str],
    *,
    retry_failed: bool,
) -> list[int]:
    """Give logs the results that are stored under their key; returns those for which there are none."""
    left = []
    for number in pending:
        known = store.by_key.get(keys.get(number, ""))
        if known is None or not known.final(retry_failed=retry_failed):
            left.append(number)
            continue
        planned = plan.logs[number]
        outcome = Outcome(planned.log, known.key, known.status, known.failure, known.reason, {})
        with held():
            state[number] = store.add(planned, computed, outcome)
    return left


def _first_of_each(pending: Iterable[int], keys: Mapping[int, str]) -> tuple[list[int], list[int]]:
    """The first log of each key, and those that wait for it.

    >>> _first_of_each([0, 1, 2, 3], {1: "a", 3: "a"})
    ([0, 1, 2], [3])
    """
    first, later, taken = [], [], set()
    for number in pending:
        own_key = keys.get(number)
        if own_key in taken:
            later.append(number)
        else:
            first.append(number)
            if own_key is not None:
                taken.add(own_key)
    return first, later


def _outcomes(
    plan: Plan, numbers: Iterable[int], settings: Settings, runner: Runner, inform: Callable[[str], None]
) -> Iterator[tuple[int, Outcome]]:
    """The outcome of each log once, whatever the runner repeats; closes the runner."""
    # the largest first: a log of two hours that came last would keep one worker busy and the others idle
    ordered = sorted(numbers, key=lambda number: -plan.logs[number].size)
    waiting = {plan.logs[number].log: number for number in ordered}
    jobs = (
        Job(planned.log, planned.size, planned.modified_ns, planned.source, settings)
        for planned in (plan.logs[number] for number in ordered)
    )
    with closing(storage_wait.outcomes(jobs, runner, inform)) as running:
        for outcome in running:
            number = waiting.pop(outcome.log, None)
            if number is not None:
                yield number, outcome
    for log, number in waiting.items():
        yield number, Outcome(log, "", Status.FAILED, Failure.CRASHED, "ended without an answer", {})


def _rows(plan: Plan, state: Sequence[Known | None]) -> Iterator[dict[str, Any]]:
    """Rows of `columns.LOGS`."""
    first: dict[str, str] = {}
    for planned, known in zip(plan.logs, state, strict=True):
        row = {
            "log": planned.log,
            "driver": planned.driver or None,
            "car": planned.car or None,
            "group_name": planned.group_name or None,
            "source": planned.source or None,
            "bytes": planned.size if planned.size != listing.MISSING else None,
            "modified_ns": planned.modified_ns or None,
            "reason": NOT_YET,
            "attempts": 0,
        }
        if known is not None:
            row |= {
                "key": known.key or None,
                "status": known.status.value,
                "failure": known.failure.value,
                "reason": known.reason,
                "analysed_utc": known.analysed_utc or None,
                "attempts": known.attempts,
            }
            if known.has_results and first.setdefault(known.key, planned.log) != planned.log:
                row["duplicate_of"] = first[known.key]
        yield row


class Counts(NamedTuple):
    """How many logs of a plan came to what."""

    logs: int
    ok: int
    damaged: int
    failed: int
    duplicates: int  # of those that are ok or damaged
    open: int  # not analysed yet
    failures: Mapping[str, int]  # why they failed -> how many
    drivers: Mapping[str, int]  # driver -> drives with results, each counted once


def counts(logs: Iterable[Mapping[str, Any]]) -> Counts:
    """Count.

    Example:
        >>> counts([{"status": "ok", "driver": "anna"}, {"status": "failed", "failure": "empty"}]).failures
        {'empty': 1}
    """
    number: Counter[str] = Counter()
    failures: Counter[str] = Counter()
    drivers: defaultdict[str, int] = defaultdict(int)
    for row in logs:
        status = row.get("status") or "open"
        number["logs"] += 1
        number[status] += 1
        if status == "failed":
            failures[str(row.get("failure"))] += 1
        elif row.get("duplicate_of"):
            number["duplicates"] += 1
        elif status != "open":
            drivers[str(row.get("driver") or "")] += 1
    ordered = dict(sorted(failures.items(), key=lambda item: (-item[1], item[0])))
    return Counts(
        number["logs"],
        number["ok"],
        number["damaged"],
        number["failed"],
        number["duplicates"],
        number["open"],
        ordered,
        dict(drivers),
    )
