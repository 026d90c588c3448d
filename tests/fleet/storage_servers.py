"""Servers of storage on loopback: S3 (moto's server), and Python's own web server; both can be stopped and started again."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import pytest

from tests.fleet.short_logs import table

HOST = "127.0.0.1"
BUCKET = "drives"
# whose results storage is held against a local folder's
LOGS = 8
WITH_RESULTS = "driver, car, key, status, range_rate_K, range_rate_K_low, duration, fit_percent"
# of moto, which takes any
CREDENTIALS = {
    "AWS_ACCESS_KEY_ID": "testing",
    "AWS_SECRET_ACCESS_KEY": "testing",
    "AWS_DEFAULT_REGION": "us-east-1",
    # of this machine
    "AWS_EC2_METADATA_DISABLED": "true",
    "AWS_CONFIG_FILE": "/dev/null",
    "AWS_SHARED_CREDENTIALS_FILE": "/dev/null",
}


def numbers(folder: Path) -> list[tuple[Any, ...]]:
    """What a folder of results says of its drives."""
    return sorted(table(folder, "drives", WITH_RESULTS), key=repr)


class S3:
    """A bucket on moto's server."""

    def __init__(self) -> None:
        self._server: Any = None
        self._port = 0
        self.start()
        self._client().create_bucket(Bucket=BUCKET)

    @property
    def endpoint(self) -> str:
        return f"http://{HOST}:{self._port}"

    def environment(self) -> dict[str, str]:
        return {**CREDENTIALS, "AWS_ENDPOINT_URL": self.endpoint}

    def is_known_here(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Let commands of this process and its children find it."""
        import fsspec

        for name, value in self.environment().items():
            monkeypatch.setenv(name, value)
        fsspec.get_filesystem_class("s3").clear_instance_cache()

    def start(self) -> None:
        """Start it, at the port that it had, with what it held."""
        from moto.server import ThreadedMotoServer

        self._server = ThreadedMotoServer(ip_address=HOST, port=self._port, verbose=False)
        self._server.start()
        self._port = self._server.get_host_and_port()[1]

    def stop(self) -> None:
        server, self._server = self._server, None
        if server is not None:
            server.stop()

    def put(self, folder: Path, prefix: str) -> None:
        """Store the files of a folder below a prefix."""
        client = self._client()
        for path in sorted(path for path in folder.rglob("*") if path.is_file()):
            client.put_object(
                Bucket=BUCKET, Key=f"{prefix}/{path.relative_to(folder).as_posix()}", Body=path.read_bytes()
            )

    def _client(self) -> Any:
        import boto3

        return boto3.client(
            "s3",
            endpoint_url=self.endpoint,
            aws_access_key_id=CREDENTIALS["AWS_ACCESS_KEY_ID"],
            aws_secret_access_key=CREDENTIALS["AWS_SECRET_ACCESS_KEY"],
            region_name=CREDENTIALS["AWS_DEFAULT_REGION"],
        )


@contextmanager
def s3() -> Iterator[S3]:
    made = S3()
    try:
        yield made
    finally:
        made.stop()


class _Handler(SimpleHTTPRequestHandler):
    """Python's own web server; slow, if it is to be."""

    pause_s = 0.0

    def copyfile(self, source: Any, outputfile: Any) -> None:
        if not self.pause_s:
            super().copyfile(source, outputfile)
            return
        while block := source.read(20_000):
            outputfile.write(block)
            time.sleep(self.pause_s)

    def log_message(self, *_: object) -> None:
        pass


class Web:
    """A folder on a web server."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._server: ThreadingHTTPServer | None = None
        self._port = 0
        self.start()

    @property
    def url(self) -> str:
        return f"http://{HOST}:{self._port}/"

    def start(self, pause_s: float = 0.0) -> None:
        """Start it, at the port that it had; `pause_s` is waited for every 20 kB."""
        handler = type("Handler", (_Handler,), {"pause_s": pause_s})
        self._server = ThreadingHTTPServer((HOST, self._port), partial(handler, directory=str(self._folder)))
        self._server.daemon_threads = True
        self._port = self._server.server_port
        threading.Thread(target=self._server.serve_forever, daemon=True).start()

    def stop(self) -> None:
        server, self._server = self._server, None
        if server is not None:
            server.shutdown()
            server.server_close()


@contextmanager
def web(folder: Path) -> Iterator[Web]:
    made = Web(folder)
    try:
        yield made
    finally:
        made.stop()
