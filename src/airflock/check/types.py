"""The removed function `check_types`, which names what replaces it; for one version."""

from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from airflock.support import AirflockError


def check_types(files: str | Path | Sequence[str | Path] = (), *, out: str | Path | None = None) -> NoReturn:
    """Raise AirflockError: this function was removed; use mypy and `airflock.check_model`.

    Parameters
    ----------
    files : str, Path or sequence of them
        Not read.
    out : str or Path, optional
        Not written.

    Returns
    -------
    NoReturn
        Nothing.

    Raises
    ------
    AirflockError
        Always, with what to use.

    Examples
    --------
    >>> import airflock
    >>> try:
    ...     airflock.check_types("mine.py")
    ... except airflock.AirflockError as error:
    ...     print(error)
    airflock types and airflock.check_types were removed; use mypy and airflock.check_model("mine.py")
    """
    raise AirflockError(
        'airflock types and airflock.check_types were removed; use mypy and airflock.check_model("mine.py")'
    )
