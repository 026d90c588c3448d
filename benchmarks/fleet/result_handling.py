"""Planning and result handling of a run, without the analysis: every log has the outcome of one real analysis.

    python -m benchmarks.fleet.result_handling FOLDER @LIST VEHICLE TEMPLATE_LOG

Runs what `canid fleet` runs (plan, journal, segments, tables), in a process of its own; prints one line of JSON.
"""

from __future__ import annotations

import hashlib
import json
import resource
import sys
import time
from collections.abc import Generator, Iterable, Mapping
from typing import Any

from canid.analysis.fleet.job import Job, Outcome, Settings
from canid.analysis.fleet.planning.plan import planned
from canid.analysis.fleet.running import local_run
from canid.analysis.fleet.running.run import run
from canid.analysis.fleet.storage import store

SETTINGS = Settings(diagnosis=False)


def template(log: str, vehicle: str) -> Outcome:
    """Analyse one log."""
    plan = planned([log], vehicle=vehicle)
    one = plan.logs[0]
    job = Job(one.log, one.size, one.modified_ns, one.source, SETTINGS)
    return next(iter(local_run.outcomes([job], plan.sources, 1)))


def main(folder: str, names: str, vehicle: str, example: str) -> None:
    """Plan and store."""
    of = template(example, vehicle)
    begin, cpu = time.perf_counter(), time.process_time()
    plan = planned([names], vehicle=vehicle, skip=[folder])
    planning = time.perf_counter() - begin

    def repeated(jobs: Iterable[Job]) -> Generator[Outcome]:
        for job in jobs:
            key = hashlib.sha256(job.log.encode()).hexdigest()
            tables: dict[str, list[Mapping[str, Any]]] = {
                name: [{**row, "key": key} for row in rows] for name, rows in of.tables.items()
            }
            yield of._replace(log=job.log, key=key, tables=tables)

    with store.opened(folder) as opened:
        done = run(plan, opened, SETTINGS, repeated)
    print(
        json.dumps(
            {
                "status": of.status.value,
                "logs": len(done.logs),
                "analysed": done.analysed,
                "planning_s": planning,
                "wall_s": time.perf_counter() - begin,
                "cpu_s": time.process_time() - cpu,
                "peak_bytes": 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
            }
        )
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
