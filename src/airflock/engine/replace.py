"""Replacement in generated text, with an error when there was nothing to replace."""

from typing import TypeVar

Text = TypeVar("Text", str, list[str])


class ReplacementError(Exception):
    """Generated text does not hold what a replacement was written for: the engine contradicts itself."""


def checked_replace(text: Text, old: str, new: str, count: int = -1) -> Text:
    """Text, or lines, with `new` in place of `old`, which must occur; callers test first where it may be absent.

    count : so many occurrences at most, from the first on; all by default

    Raises ReplacementError, which names `old` and the text, if it does not occur.
    """
    found = text if isinstance(text, str) else "\n".join(text)
    if old not in found:
        raise ReplacementError(f"{old!r} was to become {new!r}, but does not occur in:\n{found}")
    if isinstance(text, str):
        return text.replace(old, new, count)
    return [line.replace(old, new, count) for line in text]
