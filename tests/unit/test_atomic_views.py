"""What a file is written from is let go, whatever becomes of the file."""

import io
import os

import pytest

from airflock.support import atomic


def views(path):
    """The stream behind a view that was written, and what became of it."""
    stream = io.BytesIO(b"0123456789" * 1000)
    try:
        atomic.write_file(path, stream.getbuffer())
    except OSError as fault:
        return stream, fault
    return stream, None


def test_a_view_that_was_written_is_released(tmp_path):
    stream, fault = views(tmp_path / "a.nc")
    assert fault is None and (tmp_path / "a.nc").read_bytes() == b"0123456789" * 1000
    stream.close()  # BufferError where somebody still holds a view


def test_a_view_that_could_not_be_written_is_released_though_the_error_is_kept(tmp_path):
    stream, kept = views(tmp_path / "nowhere" / "a.nc")
    assert isinstance(kept, FileNotFoundError)
    stream.close()
    resource = pytest.importorskip("resource")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limits[1]))
    try:
        stream, kept = views(tmp_path / "a.nc")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert isinstance(kept, OSError) and kept.__traceback__ is not None
    assert os.listdir(tmp_path) == []
    stream.close()
