"""Starting sets for any speed: the scaling rules of Vásárhelyi et al. 2018, Tables S1 and S3, on the presets."""

import math
import tomllib

from airflock.parts.laws import Parameters
from airflock.scenarios import formats
from airflock.scenarios.files import presets

SPEEDS = (4.0, 6.0, 8.0, 16.0, 32.0)  # columns of Table S1, m/s
LINEAR = "Table S3: grows linearly with v_flock"
BETWEEN = "between the columns of Table S1"


def starting_set(v_flock: float) -> str:
    """Return a scenario file for a flocking speed, by the scaling rules of Vásárhelyi et al. 2018.

    Parameters
    ----------
    v_flock : float
        Flocking speed, m/s.

    Returns
    -------
    str
        TOML text; tune it before flying.

    Raises
    ------
    ParameterError
        If the speed lies outside the range of model.v_flock.

    Notes
    -----
    r0_rep and v_shill grow linearly with v_flock (their ratio to it, which Table S1 holds within 15 %, is interpolated
    between its columns), and v_shill is at least twice v_flock (Table S3). p_rep keeps the product p_rep · r0_rep, the
    repulsion speed at contact, which Table S1 holds near 3 m/s up to 16 m/s. The other gains are interpolated between
    the columns (geometrically in the speed), and held constant outside 4-32 m/s; so the set is Table S1 itself at its
    own speeds. Arena and radio range grow as in Table S2: with the speed above 8 m/s.

    Examples
    --------
    >>> import airflock
    >>> print(airflock.starting_set(6.0).splitlines()[8])
    v_flock = { value = 6, unit = "m/s", source = "asked for" }
    """
    Parameters(v_flock=v_flock)  # refuses what is no speed
    scale = max(1.0, v_flock / 8.0)
    growth = "Table S2: grows with the speed above 8 m/s"
    lines = [
        f"{formats.KEY} = {formats.FORMAT}",
        f'title = "Starting set for {v_flock:g} m/s, by the scaling rules of Vásárhelyi et al. 2018; '
        'tune it before flying"',
        "agents = 100",
        'duration = { value = 600.0, unit = "s", source = "Results" }',
        'dt = { value = 0.01, unit = "s", source = "authors\' program" }',
        "",
        "[model]",
        'kind = "vasarhelyi_2018"',
        *_gains(v_flock),
        "",
        "[radio]",
        f'range = {{ value = {80.0 * scale:.4g}, unit = "m", source = "{growth}" }}',
        "",
        "[world]",
        'arena = "square"',
        f'side = {{ value = {250.0 * scale:.4g}, unit = "m", source = "{growth}" }}',
        'walls = "nearest_per_axis"',
    ]
    return "\n".join(lines) + "\n"


def _gains(v_flock: float) -> list[str]:
    """Return the lines of the section [model]: each number of Table S1 for a speed, m/s, with its source."""
    columns = {
        v: tomllib.loads(presets()[f"vasarhelyi_2018/{v:g}ms"].read_text(encoding="utf-8"))["model"] for v in SPEEDS
    }

    def column(key: str) -> list[float]:
        return [columns[v][key]["value"] for v in SPEEDS]

    def proportional(key: str) -> float:
        return v_flock * _between([x / v for x, v in zip(column(key), SPEEDS, strict=True)], v_flock)

    r0_rep, v_shill = proportional("r0_rep"), proportional("v_shill")
    # Table S1 holds the repulsion speed at contact near 3 m/s up to 16 m/s, so the product is
    # interpolated and p_rep follows from it.
    contact = _between([p * r for p, r in zip(column("p_rep"), column("r0_rep"), strict=True)], v_flock)
    derived = {
        "v_flock": (v_flock, "asked for"),
        "v_max": (v_flock + 2.0, "as in Results: 2 m/s above v_flock; unused unless limit = cap"),
        "r0_rep": (r0_rep, LINEAR),
        "p_rep": (contact / r0_rep, "keeps p_rep · r0_rep of Table S1"),
        "v_shill": (max(v_shill, 2.0 * v_flock), f"{LINEAR}, at least twice v_flock"),
    }
    lines = []
    for key, entry in columns[SPEEDS[0]].items():
        if isinstance(entry, dict) and "unit" in entry:
            number, source = derived.get(key) or (_between(column(key), v_flock), BETWEEN)
            lines.append(f'{key} = {{ value = {number:.4g}, unit = "{entry["unit"]}", source = "{source}" }}')
        elif isinstance(entry, dict):
            lines.append(f'{key} = "{entry["value"]}"')
    return lines


def _between(values: list[float], v: float) -> float:
    """Interpolate a column at speed v in the logarithms of both."""
    v = min(max(v, SPEEDS[0]), SPEEDS[-1])
    for low, high, a, b in zip(SPEEDS, SPEEDS[1:], values, values[1:], strict=False):
        if v <= high:
            # Speeds of the table double, so they are evenly spaced in the logarithm.
            s = math.log(v / low) / math.log(high / low)
            return float(a ** (1.0 - s) * b**s)
    return values[-1]
