"""The recipes of docs/clusters.md do what they say, as far as they run without the machines that they are for."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from tests.fleet import certificates, short_logs
from tests.fleet.dask_processes import DASK, HOST, free_port
from tests.fleet.short_logs import QUICK, REPO, fleet_here, table

PAGE = (REPO / "docs/clusters.md").read_text("utf-8")
LOGS = 3
NUMBERS = "log, key, status, range_rate_K, duration, fit_percent"
IN_CLUSTER = "tls://canid-scheduler:8786"
KUBERNETES = "1.31"


def block(language: str) -> str:
    found = re.search(rf"^```{language}\n(.*?)^```$", PAGE, flags=re.M | re.S)
    assert found is not None
    return found[1]


def programs() -> str:
    """PATH with those of this environment first."""
    return f"{Path(DASK).parent}:{os.environ['PATH']}"


def numbers(folder: Path) -> list[tuple[Any, ...]]:
    return sorted(table(folder, "drives", NUMBERS), key=repr)


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    short_logs.write(tmp_path / "logs", LOGS, 8.0)
    return tmp_path / "logs"


def expected(logs: Path) -> list[tuple[Any, ...]]:
    into = logs.parent / "local"
    assert fleet_here(logs, "-o", into, *QUICK).returncode == 0
    return numbers(into)


@pytest.mark.slow("a cluster of Dask in processes of their own")
def test_the_job_that_slurm_is_given_analyses_the_fleet(logs: Path, tmp_path: Path) -> None:
    """A shell takes the place of Slurm: `sbatch` runs the script that it is given."""
    pytest.importorskip("dask_jobqueue", reason="needs dask-jobqueue: pip install dask-jobqueue")
    program = block("python on_slurm").replace("cores=8", "cores=1").replace("maximum=20", "maximum=1")
    program = program.replace("ib0", "lo")
    (tmp_path / "on_slurm.py").write_text(program)
    for name, does in (
        ("sbatch", 'sh "$1" > job.txt 2>&1 & echo $! > job.pid; echo "Submitted batch job 1"'),
        ("scancel", "kill $(cat job.pid)"),
    ):
        (tmp_path / name).write_text(f"#!/bin/sh\n{does}\n")
        (tmp_path / name).chmod(0o755)
    done = subprocess.run(
        [sys.executable, "on_slurm.py", str(logs), "-o", str(tmp_path / "out"), *QUICK],
        cwd=tmp_path,
        env={**short_logs.environment(), **certificates.made(tmp_path), "PATH": f"{tmp_path}:{programs()}"},
        capture_output=True,
        text=True,
        timeout=short_logs.PATIENCE_S,
        check=False,
    )
    assert (done.returncode, f"{LOGS} ok" in done.stdout) == (0, True), done
    assert numbers(tmp_path / "out") == expected(logs)


def manifest() -> list[dict[str, Any]]:
    yaml = pytest.importorskip("yaml", reason="needs PyYAML")
    return list(yaml.safe_load_all(block("yaml")))


def test_the_manifest_is_one_of_kubernetes() -> None:
    """Each object against the schema of its kind, which knows no other keys; labels and ports meet."""
    validate = pytest.importorskip("kubernetes_validate", reason="needs kubernetes-validate")
    objects = manifest()
    assert [one["kind"] for one in objects] == ["Service", "Deployment", "Deployment", "Job"]
    for one in objects:
        validate.validate(one, KUBERNETES, strict=True)
    service, scheduler, worker, job = objects
    assert service["spec"]["selector"] == scheduler["spec"]["template"]["metadata"]["labels"]
    for one in (scheduler, worker):
        assert one["spec"]["selector"]["matchLabels"] == one["spec"]["template"]["metadata"]["labels"]
    address = f"tls://{service['metadata']['name']}:{service['spec']['ports'][0]['port']}"
    assert address == IN_CLUSTER
    assert address in worker["spec"]["template"]["spec"]["containers"][0]["command"]
    for one in (scheduler, worker, job):
        of_pod = one["spec"]["template"]["spec"]
        (container,) = of_pod["containers"]
        assert {"name": "DASK_CONFIG", "value": f"{certificates.OF_PAGE}/dask.yaml"} in container["env"]
        assert {"name": "tls", "mountPath": certificates.OF_PAGE} in container["volumeMounts"]
        assert "tls" in {volume["name"] for volume in of_pod["volumes"]}
    assert address in job["spec"]["template"]["spec"]["containers"][0]["args"]


@pytest.mark.slow("a cluster of Dask in processes of their own")
def test_the_commands_of_the_manifest_analyse_the_fleet(logs: Path, tmp_path: Path) -> None:
    """Scheduler, worker and job as processes of this machine; the address, the logs and the vehicle are other ones."""
    _, scheduler, worker, job = (
        one["spec"].get("template", {}).get("spec", {}).get("containers", [{}])[0] for one in manifest()
    )
    port = free_port()
    environment = {**short_logs.environment(), **certificates.made(tmp_path)}
    others = {
        IN_CLUSTER: f"tls://{HOST}:{port}",
        "eth0": "lo",
        "8786": str(port),
        "8": "1",
        "s3://bucket/drives": str(logs),
        "s3://bucket/results": str(tmp_path / "out"),
        "/vehicle/car.toml": "generic",
    }

    def words(of: list[str]) -> list[str]:
        return [others.get(word, word) for word in of]

    running = [
        subprocess.Popen(
            words(one["command"]),
            cwd=tmp_path,
            env={**environment, "PATH": programs()},
            stderr=subprocess.DEVNULL,
        )
        for one in (scheduler, worker)
    ]
    try:
        of_job = [sys.executable, "-m", "canid", *words(job["args"]), *QUICK[2:]]
        done = subprocess.run(
            of_job,
            cwd=REPO,
            env=environment,
            capture_output=True,
            text=True,
            timeout=short_logs.PATIENCE_S,
            check=False,
        )
    finally:
        for one in reversed(running):
            one.terminate()
            one.wait()
    assert (done.returncode, f"{LOGS} ok" in done.stdout) == (0, True), done
    assert numbers(tmp_path / "out") == expected(logs)
