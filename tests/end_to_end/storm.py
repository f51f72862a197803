"""Many uploads at once, as `python -m tests.end_to_end.storm PORT FILE`; the answers go to FILE as JSON.

A process of its own, so that what it costs to send is not taken for the server's slowness.
"""

import asyncio
import json
import os
import sys
from pathlib import Path

from tests.app.raw import form, head
from tests.app.scripts import upload

CLIENTS = 300
UPLOAD_BYTES = 2_000_000
PIECE_BYTES = 65_536


async def send_photo(port: int, request: bytes) -> dict[str, object]:
    """Send it all first and read later, as most clients do."""
    reader, writer = await asyncio.open_connection("127.0.0.1", port)
    try:
        for start in range(0, len(request), PIECE_BYTES):
            writer.write(request[start : start + PIECE_BYTES])
            await writer.drain()
        status = int((await reader.readline()).split()[1])
        headers = {}
        while line := (await reader.readline()).strip():
            name, _, value = line.decode("latin-1").partition(":")
            headers[name.lower()] = value.strip()
        body = await reader.readexactly(int(headers["content-length"]))
        return {"status": status, "headers": headers, "body": body.decode()}
    except OSError as error:
        return {"status": None, "error": repr(error)}
    finally:
        writer.close()


async def storm(port: int) -> list[dict[str, object]]:
    """All answers, in no order."""
    image = upload("sleep 0.05")
    body = form(image + b" " * (UPLOAD_BYTES - len(image)))
    request = head(len(body)) + body
    return await asyncio.gather(*(send_photo(port, request) for _ in range(CLIENTS)))


if __name__ == "__main__":
    os.nice(10)  # clients do not compute on the server's processors
    Path(sys.argv[2]).write_text(json.dumps(asyncio.run(storm(int(sys.argv[1])))), encoding="utf-8")
