"""Addresses outside: each is found in the texts, and what a server answers is told apart."""

import sys
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "docs"))

import addresses  # noqa: E402


class Answers(BaseHTTPRequestHandler):
    """Answers with the status that is asked for."""

    def do_GET(self):
        self.send_response(int(self.path[1:]))
        self.end_headers()

    def log_message(self, *_):
        """Say nothing."""


@pytest.fixture
def server():
    with ThreadingHTTPServer(("127.0.0.1", 0), Answers) as running:
        Thread(target=running.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{running.server_port}"
        running.shutdown()


def test_what_a_server_answers_is_told_apart(server):
    told = {code: addresses.answer(f"{server}/{code}") for code in (200, 403, 404, 429, 500)}
    assert told == {200: "", 403: "", 404: "status 404", 429: "", 500: "status 500"}


def test_what_nobody_serves_has_no_answer():
    assert addresses.answer("http://127.0.0.1:9/").startswith("no answer: ")


def test_the_publications_of_the_readme_are_asked_of_the_register():
    found = addresses.addresses()
    assert "README.md" in found["https://doi.org/10.1126/scirobotics.aat3536"]
    assert "references.bib" in found["https://doi.org/10.1016/S0045-7825(99)00389-8"]
    assert not any("127.0.0.1" in address or "localhost" in address for address in found)
