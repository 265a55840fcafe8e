"""Who may talk to the server: its own pages, on this machine, by the address with the token."""

from __future__ import annotations

import secrets
from collections.abc import Mapping

from starlette.datastructures import Headers
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send

#: What a page of ours may load, and where it may send.
HEADERS: Mapping[str, str] = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cache-Control": "no-store",
}


class Guard:
    """Refuses requests and sockets without the token, from other hosts or from other pages.

    The token is the first part of the path, so that all addresses of the page have it.
    """

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        self._app, self._token = app, token
        self._hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or refuse."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        if self._allows(scope):
            await self._app(scope, receive, send)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        else:
            refused = PlainTextResponse("Open the address that the terminal shows.", 403, dict(HEADERS))
            await refused(scope, receive, send)

    def _allows(self, scope: Scope) -> bool:
        headers = Headers(scope=scope)
        origin, host = headers.get("origin"), headers.get("host", "")
        first = scope["path"].lstrip("/").partition("/")[0]
        reads = scope["type"] == "http" and scope["method"] in ("GET", "HEAD")
        own = origin == f"http://{host}" or (origin is None and reads)
        return (
            host in self._hosts
            and own
            and headers.get("sec-fetch-site", "none") in ("none", "same-origin")
            and secrets.compare_digest(first.encode("utf-8", "replace"), self._token.encode())
        )
