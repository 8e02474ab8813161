"""Access to a page: a token in the address, then a cookie; every other request is refused.

The web server of viser has no such check. It serves through `websockets`, whose one call is wrapped
while the server starts; the same place gives the page a few lines of its own (keys on a slider do
not turn the camera; sliders, fields and buttons have names for screen readers; folders open by the
keyboard; commands can be copied).
"""

import hmac
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from typing import Any
from unittest.mock import patch
from urllib.parse import parse_qs, urlsplit

import websockets.asyncio.server
from websockets.datastructures import Headers
from websockets.http11 import Response

REFUSAL_PAGE = b"airflock: this page needs the whole address that the terminal shows, with its token\n"
PAGE_SCRIPT = b"""<script>
addEventListener("DOMContentLoaded", () => {
  const field = '[role=slider], input, textarea, [role=combobox]';
  for (const kind of ["keydown", "keyup"])
    document.body.addEventListener(kind, e => { if (e.target.closest?.(field)) e.stopPropagation(); });
  const name = () => {
    const bare = "[role=slider]:not([aria-label]), [role=slider][aria-label=''], input:not([aria-label]):not([type])";
    for (const input of document.querySelectorAll(bare + ", input[type=text]:not([aria-label])")) {
      if (input.labels?.length) continue;
      let at = input;
      while ((at = at.parentElement) && at !== document.body) {
        const label = at.querySelector("label");
        if (label) { input.setAttribute("aria-label", label.textContent); break; }
      }
    }
    for (const icon of document.querySelectorAll("button:not([aria-label]) svg[class*='tabler-icon-']")) {
      const button = icon.closest("button"), kind = /tabler-icon-([a-z-]+)/.exec(icon.getAttribute("class"));
      if (kind && !button.textContent.trim()) button.setAttribute("aria-label", kind[1].replaceAll("-", " "));
    }
    for (const mark of document.querySelectorAll("[style*='cursor: pointer'] > svg[class*='tabler-icon-chevron']")) {
      const head = mark.parentElement;  // of a folder
      if (head.hasAttribute("tabindex")) continue;
      head.tabIndex = 0;
      head.setAttribute("role", "button");
      head.addEventListener("keydown", e => {
        if (e.key === "Enter" || e.key === " ") { head.click(); e.preventDefault(); e.stopPropagation(); }
      });
    }
  };
  document.addEventListener("click", e => {
    const text = e.target.closest?.("[data-copy]")?.dataset.copy;
    if (text === undefined) return;
    const done = () => { e.target.textContent = "Copied"; };
    const by_hand = () => {  // where the address is not that of this machine, browsers keep the clipboard closed
      const field = document.body.appendChild(document.createElement("textarea"));
      field.value = text;
      field.select();
      if (document.execCommand("copy")) done();
      field.remove();
    };
    navigator.clipboard ? navigator.clipboard.writeText(text).then(done, by_hand) : by_hand();
  });
  new MutationObserver(name).observe(document.body, { childList: true, subtree: true });
});
</script>"""


def check_access(
    path: str, cookies: str, cookie_name: str, token: str, origin: str = "", host: str = ""
) -> tuple[bool, bool]:
    """Return two booleans: whether a request may pass, and whether it came with the token in its address.

    path   : with its query; cookies : the header; name : of the cookie that holds the token
    origin : header with the address of the requesting page, if any; host : header with the address
             of this page

    A browser sends the cookie also for pages of other ports of the same machine: they are turned
    away.
    """
    try:
        given = parse_qs(urlsplit(path).query).get("token", [""])[0]
        # Constant time: the time of an answer must not reveal how much of a token was right.
        if hmac.compare_digest(given.encode(), token.encode()):
            return True, True
        kept = SimpleCookie(cookies)
        origin_host = urlsplit(origin).netloc
    except (CookieError, ValueError):  # what a stranger sends may be no address at all
        return False, False
    value = kept[cookie_name].value if cookie_name in kept else ""
    return hmac.compare_digest(value.encode(), token.encode()) and (not origin or origin_host == host), False


@contextmanager
def require_token(token: str, port: int) -> Iterator[None]:
    """Let the servers of websockets that start inside require the token."""
    # viser has no access control, so the server is wrapped while it starts; the web socket
    # included.
    serve, name = websockets.asyncio.server.serve, f"airflock_{port}"

    def with_check(handler: Any, *where: Any, process_request: Callable[..., Any], **rest: Any) -> Any:
        def check(connection: Any, request: Any) -> Any:
            cookies, origin, host = ("; ".join(request.headers.get_all(n)) for n in ("Cookie", "Origin", "Host"))
            passes, sets_cookie = check_access(request.path, cookies, name, token, origin, host)
            if not passes:
                return Response(
                    HTTPStatus.FORBIDDEN, "Forbidden", Headers({"Content-Type": "text/plain"}), REFUSAL_PAGE
                )
            page = urlsplit(request.path).path in ("", "/", "/index.html")
            # The page must arrive uncompressed, because the script is inserted into its bytes.
            if page and "Accept-Encoding" in request.headers:
                del request.headers["Accept-Encoding"]
            answer = process_request(connection, request)
            if page and answer is not None and answer.body is not None:
                answer.body = answer.body.replace(b"<head>", b"<head>" + PAGE_SCRIPT, 1)
                del answer.headers["Content-Length"]
                answer.headers["Content-Length"] = str(len(answer.body))
            if sets_cookie and answer is not None:
                answer.headers["Set-Cookie"] = f"{name}={token}; HttpOnly; SameSite=Strict; Path=/"
            return answer

        return serve(handler, *where, process_request=check, **rest)

    with patch.object(websockets.asyncio.server, "serve", with_check):
        yield
