"""Lengths: without one that fits, some order parameters of tracks say nothing; 3 m of a drone are not a fish's.

A simulated recording brings its scenario. Tracks and logs bring none, so that what counts as near, as apart or as the
speed that is wanted must be said; what depends on a number that nobody said is not told, nor is an excursion where
nobody said out of what, nor a rotation where nobody said about which point: the origin is a corner of a picture.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from airflock.support import RecordingError, is_number

FITNESS = "r_cluster", "r_coll", "r_comm", "v_flock"
# Order parameter: keys of `metrics` that it depends on.
NEEDS: dict[str, tuple[str, ...]] = {
    **dict.fromkeys(("phi_coll", "n_coll", "f_coll"), ("r_coll",)),
    **dict.fromkeys(("phi_corr", "f_corr", "n_min", "f_cluster", "n_clusters", "n_stragglers"), ("r_cluster",)),
    **dict.fromkeys(("n_groups", "share_alone", "share_largest", "local_density"), ("r_cluster",)),
    **dict.fromkeys(("extension_groups_cm", "polarization_groups_deg"), ("r_cluster",)),
    **dict.fromkeys(("n_disc", "f_disc"), ("r_comm",)),
    **dict.fromkeys(("f_collision", "cns_pol"), ("r_b",)),
    **dict.fromkeys(("cns_ext", "quality"), ("max_e", "r_b")),
    **dict.fromkeys(("cns_ext_groups", "quality_groups"), ("max_e", "r_b", "r_cluster")),
    "cns_pol_groups": ("r_b", "r_cluster"),
    **dict.fromkeys(("flocked", "time_to_flock"), ("r_flock",)),
    **dict.fromkeys(("n_contacts", "touching", "n_env_coll", "f_env"), ("r_body",)),
    "crowding": ("r_safe",),
    "f_speed": ("v_flock",),
    "f_wall": ("r_tol",),
    **dict.fromkeys(("phi_lap", "phi_lap_abs"), ("centre_x", "centre_y")),
}
FITNESSES = {"vasarhelyi": FITNESS, "kidger": ("r_coll", "r_flock"), "dimock": ("r_coll",)}
IN_BODIES = {"r_coll": 0.5, "r_body": 0.5, "r_b": 0.5, "r_safe": 1.0, "r_cluster": 5.0, "r_comm": 5.0}


def body_length_settings(length: float) -> dict[str, float]:
    """Settings that measure in lengths of a body.

    Two bodies touch where their centres are half a length apart, and belong together up to five lengths: our choice,
    since nothing that is published fits all animals. Say `metrics.r_cluster` and the like where you know better.

    Parameters
    ----------
    length : float
        Length of a body, m.

    Returns
    -------
    dict
        Keys of a scenario and lengths in m.

    Raises
    ------
    RecordingError
        If the length is not a positive number.
    """
    if not is_number(length):
        raise RecordingError(f"body_length = {length!r} is not a number; give (0, 1000] m")
    if not 0.0 < length <= 1000.0:
        raise RecordingError(f"body_length = {length:g} m lies outside (0, 1000] m")
    return {f"metrics.{key}": share * length for key, share in IN_BODIES.items()}


def undefined_metrics(
    names: Iterable[str], kind: str, settings: Mapping[str, Any], *, arena: bool
) -> dict[str, tuple[str, ...]]:
    """Order parameters of a metric set that depend on keys which settings do not give, and these keys.

    arena : whether settings give one, without which nobody is ever outside
    """
    needs = {**NEEDS, "fitness": FITNESSES.get(kind, ())}
    missing = {name: tuple(key for key in needs.get(name, ()) if f"metrics.{key}" not in settings) for name in names}
    outside = {"phi_wall": ("world.arena",)} if "phi_wall" in missing and not arena else {}
    return {name: keys for name, keys in missing.items() if keys} | outside


def missing_lengths_note(undefined: Mapping[str, tuple[str, ...]]) -> str:
    """One line that names what is not told and what to give."""
    keys = sorted({key for needed in undefined.values() for key in needed})
    lengths = " or ".join(filter(None, (
        "--body-length 0.04" if set(keys) & IN_BODIES.keys() else "",
        " ".join(f"--set {key if '.' in key else f'metrics.{key}'}=..." for key in keys),
    )))  # fmt: skip
    return f"not shown, as tracks do not say what is near, fast or the centre: {', '.join(undefined)}; give {lengths}"
