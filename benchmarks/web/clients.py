"""Websocket clients of a live page, as processes of their own: prompt, stalled and flooding ones.

    python -m benchmarks.web.clients URL --prompt N --stalled N --flooding N

Each estimate's first arrival at the first prompt client is printed: estimator, its time, wall clock. At the end of
standard input the clients leave.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import socket
import sys
import time
from typing import Any
from urllib.parse import urlsplit

from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed


async def open_socket(url: str, **options: Any) -> Any:
    """A websocket to the page at `url`."""
    parts = urlsplit(url)
    return await connect(
        f"ws://{parts.netloc}/live",
        origin=f"http://{parts.netloc}",
        subprotocols=["canid", parts.fragment.removeprefix("token=")],
        max_size=2**26,
        **options,
    )


async def prompt(url: str, *, prints: bool) -> None:
    """Read everything at once."""
    seen: set[tuple[str, float]] = set()
    client = await open_socket(url)
    try:
        async for text in client:
            now = time.time()
            for message in json.loads(text).get("messages", ()):
                key = (
                    (message["value"]["estimator"], message["value"]["t"])
                    if message["kind"] == "estimate"
                    else None
                )
                if prints and key is not None and key not in seen:
                    seen.add(key)
                    print(*key, now, flush=True)
    except ConnectionClosed:
        pass


async def flooding(url: str) -> None:
    """Send as fast as it goes, and come back when thrown out."""
    while True:
        try:
            client = await open_socket(url)
            while True:
                await client.send('{"do": "mark", "text": "flood"}')
        except (ConnectionClosed, OSError):
            await asyncio.sleep(0.05)


async def stalled(url: str) -> None:
    """Open a websocket by hand with the smallest buffer, and never read."""
    parts = urlsplit(url)
    assert parts.hostname is not None
    assert parts.port is not None
    raw = socket.socket()
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    raw.connect((parts.hostname, parts.port))
    raw.sendall(
        f"GET /live HTTP/1.1\r\nHost: {parts.netloc}\r\nOrigin: http://{parts.netloc}\r\n"
        f"Sec-WebSocket-Protocol: canid, {parts.fragment.removeprefix('token=')}\r\n"
        "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n".encode()
    )
    await asyncio.Event().wait()


async def main() -> None:
    """Run them until standard input ends."""
    parser = argparse.ArgumentParser()
    parser.add_argument("url")
    for kind in ("prompt", "stalled", "flooding"):
        parser.add_argument(f"--{kind}", type=int, default=0)
    args = parser.parse_args()
    tasks = [asyncio.create_task(prompt(args.url, prints=k == 0)) for k in range(args.prompt)]
    tasks += [asyncio.create_task(stalled(args.url)) for _ in range(args.stalled)]
    tasks += [asyncio.create_task(flooding(args.url)) for _ in range(args.flooding)]
    await asyncio.to_thread(sys.stdin.read)
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


if __name__ == "__main__":
    asyncio.run(main())
