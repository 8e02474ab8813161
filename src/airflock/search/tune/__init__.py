"""Tune: from logs or a start to evolved, hardened and certified numbers, in one folder."""
