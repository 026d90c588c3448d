"""A run of a fleet: what the folder knows already is skipped, the rest is analysed, and every outcome stored."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from typing import Any, NamedTuple

from canid.errors import OutputError
from canid.fleet import consolidated, listing, outcome_rows, same_bytes
from canid.fleet.held_signals import held
from canid.fleet.job import Failure, Job, Outcome, Settings, Status
from canid.fleet.key import key
from canid.fleet.outcome_rows import Known
from canid.fleet.plan import Plan, PlannedLog
from canid.fleet.same_bytes import File
from canid.fleet.store import Store

# who analyses: `local_run.outcomes` or `dask_run.outcomes` with all but the jobs bound; closing it ends what runs
Runner = Callable[[Iterable[Job]], Generator[Outcome]]
NOT_YET = "not analysed yet: the run was interrupted; the same command goes on"


class Progress(NamedTuple):
    """How far a run is."""

    done: int  # logs that were analysed
    total: int  # logs that are to be
    failed: int  # of those that are done


class Run(NamedTuple):
    """What came of a run."""

    logs: Sequence[Mapping[str, Any]]  # rows of `columns.LOGS`
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
) -> Run:
    """Analyse what is new, and write the tables.

    An interruption (`KeyboardInterrupt`) or an error ends it early: what was finished is stored and in the tables, and the
    exception is raised again.

    Args:
        plan: the logs.
        store: the open folder.
        settings: of the analysis.
        runner: gives the outcomes of jobs, in any order; it is closed where the run ends early.
        retry_failed: try all logs again that failed, not only those that another attempt may mend.
        progress: is called after every log.
        hashing: is called with the share of the bytes that are compared with those of other logs.

    Raises:
        OutputError: the folder cannot be written, such as on a full disk.
    """
    computed = outcome_rows.computed(settings)
    state: list[Known | None] = []
    pending: list[int] = []
    for number, one in enumerate(plan.logs):
        found = _planned(one) or store.by_identity.get(outcome_rows.identity(one, computed))
        state.append(found)
        if not one.failure.value and (found is None or not found.final(retry_failed=retry_failed)):
            pending.append(number)
    analysed = 0
    finished = False
    try:
        keys = _keys(plan, store, pending, settings, hashing)
        pending = _adopted(plan, store, computed, state, pending, keys, retry_failed=retry_failed)
        total = len(pending)
        failed = 0
        progress(Progress(0, total, 0))
        while pending:
            first, later = _first_of_each(pending, keys)
            for number, outcome in _outcomes(plan, first, settings, runner):
                with held():
                    state[number] = store.add(plan.logs[number], computed, outcome)
                analysed += 1
                failed += outcome.status is Status.FAILED
                progress(Progress(analysed, total, failed))
            # copies take the results of the first; where those did not come, they are analysed themselves
            pending = _adopted(plan, store, computed, state, later, keys, retry_failed=False)
            total -= len(later) - len(pending)
        finished = True
    finally:
        # after an error, such as of a full disk, as far as it goes: what is in the journal is safe already
        logs = [*_rows(plan, state)]
        if finished:
            _write(store, logs)
        else:
            with suppress(OutputError):
                _write(store, logs)
    return Run(logs, analysed)


def _write(store: Store, logs: Sequence[Mapping[str, Any]]) -> None:
    store.seal()
    consolidated.written(store.folder, logs)


def _planned(one: PlannedLog) -> Known | None:
    """The state of a log that cannot be analysed."""
    if not one.failure.value:
        return None
    return Known("", Status.FAILED, one.failure, one.reason, "", 0, one.size)


def _keys(
    plan: Plan, store: Store, pending: Sequence[int], settings: Settings, hashing: Callable[[float], None]
) -> dict[int, str]:
    """Keys of the pending logs whose bytes another log may have as well."""
    files = [
        File(one.log, one.size, number)
        for number in pending
        if not listing.is_url((one := plan.logs[number]).log)
    ]
    stored = {one.size for one in store.by_key.values()}
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
        found = store.by_key.get(keys.get(number, ""))
        if found is None or not found.final(retry_failed=retry_failed):
            left.append(number)
            continue
        one = plan.logs[number]
        outcome = Outcome(one.log, found.key, found.status, found.failure, found.reason, {})
        with held():
            state[number] = store.add(one, computed, outcome)
    return left


def _first_of_each(pending: Iterable[int], keys: Mapping[int, str]) -> tuple[list[int], list[int]]:
    """The first log of each key, and those that wait for it.

    >>> _first_of_each([0, 1, 2, 3], {1: "a", 3: "a"})
    ([0, 1, 2], [3])
    """
    first, later, taken = [], [], set()
    for number in pending:
        of = keys.get(number)
        if of in taken:
            later.append(number)
        else:
            first.append(number)
            if of is not None:
                taken.add(of)
    return first, later


def _outcomes(
    plan: Plan, numbers: Iterable[int], settings: Settings, runner: Runner
) -> Iterator[tuple[int, Outcome]]:
    """The outcome of each log once, whatever the runner repeats; closes the runner."""
    # the largest first: a log of two hours that came last would keep one worker busy and the others idle
    ordered = sorted(numbers, key=lambda number: -plan.logs[number].size)
    waiting = {plan.logs[number].log: number for number in ordered}
    jobs = (
        Job(one.log, one.size, one.modified_ns, one.source, settings)
        for one in (plan.logs[number] for number in ordered)
    )
    with closing(runner(jobs)) as running:
        for outcome in running:
            number = waiting.pop(outcome.log, None)
            if number is not None:
                yield number, outcome
    for log, number in waiting.items():
        yield number, Outcome(log, "", Status.FAILED, Failure.CRASHED, "ended without an answer", {})


def _rows(plan: Plan, state: Sequence[Known | None]) -> Iterator[dict[str, Any]]:
    """Rows of `columns.LOGS`."""
    first: dict[str, str] = {}
    for one, found in zip(plan.logs, state, strict=True):
        row = {
            "log": one.log,
            "driver": one.driver or None,
            "car": one.car or None,
            "group_name": one.group_name or None,
            "source": one.source or None,
            "bytes": one.size if one.size != listing.MISSING else None,
            "modified_ns": one.modified_ns or None,
            "reason": NOT_YET,
            "attempts": 0,
        }
        if found is not None:
            row |= {
                "key": found.key or None,
                "status": found.status.value,
                "failure": found.failure.value,
                "reason": found.reason,
                "analysed_utc": found.analysed_utc or None,
                "attempts": found.attempts,
            }
            if found.has_results and first.setdefault(found.key, one.log) != one.log:
                row["duplicate_of"] = first[found.key]
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
    of: Counter[str] = Counter()
    failures: Counter[str] = Counter()
    drivers: defaultdict[str, int] = defaultdict(int)
    for row in logs:
        status = row.get("status") or "open"
        of["logs"] += 1
        of[status] += 1
        if status == "failed":
            failures[str(row.get("failure"))] += 1
        elif row.get("duplicate_of"):
            of["duplicates"] += 1
        elif status != "open":
            drivers[str(row.get("driver") or "")] += 1
    ordered = dict(sorted(failures.items(), key=lambda one: (-one[1], one[0])))
    return Counts(
        of["logs"],
        of["ok"],
        of["damaged"],
        of["failed"],
        of["duplicates"],
        of["open"],
        ordered,
        dict(drivers),
    )
