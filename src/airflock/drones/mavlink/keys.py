"""Key files: 32 bytes as 64 hexadecimal digits, readable by their owner alone."""

import os
from pathlib import Path

from airflock.support import LinkError, os_error_message

KEY_LENGTH = 32  # bytes


def write_key(path: Path, key: bytes) -> None:
    """Write a key to a new file of mode 0600; never over another."""
    try:
        handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except FileExistsError as fault:
        raise LinkError(f"{path}: exists; a key is never overwritten") from fault
    try:
        with os.fdopen(handle, "w", encoding="ascii") as file:
            file.write(key.hex() + "\n")
    except OSError as fault:  # a full disk; half a key is none
        path.unlink(missing_ok=True)
        raise LinkError(f"{path}: cannot be written: {os_error_message(fault)}") from fault


def read_key(path: Path) -> bytes:
    """Key from its file; refused if others can read it."""
    try:
        mode, text = path.stat().st_mode, path.read_text(encoding="ascii").strip()
    except OSError as fault:
        raise LinkError(f"{path}: the key cannot be read: {os_error_message(fault)}") from fault
    except UnicodeDecodeError as fault:
        raise LinkError(f"{path}: is not a key; give {2 * KEY_LENGTH} hexadecimal digits") from fault
    if mode & 0o077:
        raise LinkError(f"{path}: is readable by others (mode {mode & 0o777:04o}); chmod 600 {path}")
    try:
        key = bytes.fromhex(text)
    except ValueError:
        key = b""
    if len(key) != KEY_LENGTH:
        raise LinkError(f"{path}: is not a key; give {2 * KEY_LENGTH} hexadecimal digits")
    return key
