"""What `gpu.py` measured, row by row beside the bounds that the project set beforehand."""

from collections.abc import Callable
from typing import Any

# what, bound in words, where its figure is, whether it holds, whether a miss is a disagreement and not a time
Row = tuple[str, str, Callable[[dict[str, Any]], float | None], Callable[[float], bool], bool]


def _evaluations(found: dict[str, Any], flocks: int, key: str) -> float | None:
    rows = [row for row in found["evaluations"] if row["flocks"] == flocks]
    return float(rows[0][key])


def _slower(found: dict[str, Any], flocks: int) -> float:
    return 1.0 / float(_evaluations(found, flocks, "speed against CUDA C") or 0.0)


def rows(sizes: Any) -> list[Row]:
    """All rows for these sizes."""
    full, few = sizes.saturated, sizes.generation
    count = sizes.generation * sizes.generations
    return [
        (f"evaluations per second, {full} flocks, against CUDA C", ">= 0.92, aim 1",
         lambda f: _evaluations(f, full, "speed against CUDA C"), lambda x: x >= 0.92, False),
        (f"evaluations per second, {full} flocks", "aim 10,000",
         lambda f: _evaluations(f, full, "airflock per second"), lambda x: x >= 10_000, False),
        (f"one generation of {few}: time against CUDA C", "<= 1.2, aim 1",
         lambda f: _slower(f, few), lambda x: x <= 1.2, False),
        (f"{count} evaluations in {sizes.generations} dependent generations, optimiser included, s", "<= 8",
         lambda f: f["evolution"]["seconds"], lambda x: x <= 8.0, False),
        (f"{sizes.boids} boids in 3-D, steps per second", ">= 1,700, aim 2,000",
         lambda f: f["big flock"]["airflock steps per second"], lambda x: x >= 1700.0, False),
        ("their neighbours", "about 16", lambda f: f["big flock"]["neighbours"], lambda x: 12.0 < x < 24.0, False),
        (f"{sizes.boids} boids, speed against JAX", ">= 3",
         lambda f: f["JAX"].get("speed against JAX"), lambda x: x >= 3.0, False),
        ("JAX and Airflock after 10 steps in float64, m", "<= 1e-9",
         lambda f: f["JAX"].get("apart in float64"), lambda x: x <= 1e-9, True),
        (f"CPU and GPU, {sizes.flights} flights: farthest mean of an order parameter, standard errors", "<= 3.5",
         lambda f: max(abs(row["z"]) for row in f["agreement"]["order parameters"].values()), lambda x: x <= 3.5, True),
        (f"CPU and GPU in float64 over {sizes.apart:g} s, m and m/s", "<= 1e-9",
         lambda f: f["apart"]["largest difference"], lambda x: x <= 1e-9, True),
        ("second start to the end of the first launch, s", "<= 2",
         lambda f: f["second start"]["second"], lambda x: x <= 2.0, False),
    ]  # fmt: skip


def table(found: dict[str, Any], sizes: Any) -> tuple[str, bool]:
    """The rows as a Markdown table, and whether anything disagrees or could not be measured at all."""
    lines = ["| what | bound | outcome | |", "|---|---|---|---|"]
    wrong = any(isinstance(part, str) and part.startswith("failed") for part in found.values())
    for what, bound, figure, holds, disagreement in rows(sizes):
        try:
            value = figure(found)
        except (AttributeError, LookupError, TypeError, ZeroDivisionError):  # its part failed, and says so above
            value = None
        fine = value is not None and holds(value)
        wrong |= disagreement and value is not None and not fine
        verdict = "not measured" if value is None else ("holds" if fine else "misses")
        lines.append(f"| {what} | {bound} | {'' if value is None else f'{value:.4g}'} | {verdict} |")
    return "\n".join(lines), wrong
