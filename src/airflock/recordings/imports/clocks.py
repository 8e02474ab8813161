"""Clocks: those of several devices on one time, by GNSS time, or refused."""

import numpy as np

from airflock.recordings.imports.track import ImportedTrack, ImportReport


def align_clocks(tracks: list[ImportedTrack], same_clock: bool, findings: ImportReport) -> bool:
    """Put all times on one clock, in place; returns whether quantities between individuals mean something.

    same : the user says that the clocks agree
    """
    files = {track.source for track in tracks}
    if len(files) < 2 and len(tracks) == 1:
        return True
    own = [track for track in tracks if track.clock in ("boot", "own")]
    if not own or same_clock:
        return True
    lacking = [track for track in own if track.utc is None]
    if lacking and len({track.source for track in tracks}) > 1:
        names = ", ".join(sorted({track.source for track in lacking})[:3])
        findings.fault(
            f"{names}{' ...' if len(lacking) > 3 else ''}: nothing says that the clocks of {len(files)} files "
            "agree, and distances between individuals need that; write --same-clock if they do, or --map utc:=COLUMN"
        )
        return False
    if len(lacking) == len(own):
        return True  # all of one file, whose clock is theirs
    worst = max(to_utc(track) for track in own if track.utc is not None)
    findings.notes.append(f"clocks aligned by GNSS time, largest residual {1e3 * worst:.1f} ms")
    return True


def to_utc(track: ImportedTrack) -> float:
    """Replace own time by UTC, by a straight line through the pairs; returns the largest residual, s."""
    assert track.utc is not None
    own, utc = track.utc.T
    centre = own.mean()
    offset = utc - own
    ahead = offset - offset.mean()
    spread = float(((own - centre) ** 2).sum())
    # a drift can only be told over minutes: quartz drifts by 1e-5, a packet of the receiver is late by 0.1 s
    drift = float((ahead * (own - centre)).sum() / spread) if own.max() - own.min() > 60.0 else 0.0
    residual = ahead - drift * (own - centre)
    track.time = track.time + offset.mean() + drift * (track.time - centre)
    track.clock = "utc"
    return float(np.abs(residual).max())
