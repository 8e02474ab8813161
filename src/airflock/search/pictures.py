"""Pictures of a finished study, drawn into its folder."""

from pathlib import Path

from airflock.runs import FlightStore
from airflock.search import tables
from airflock.search.nondominated import pareto_front
from airflock.search.result import EvolveResult
from airflock.search.study import Study


def draw_study(study: Study, store: FlightStore, result: EvolveResult, folder: Path) -> list[Path]:
    """Convergence, fitness against parameters, pairwise slices; with several objectives the front."""
    from airflock.view import convergence, fitness_scatter, pareto, save_figure, slices

    first = study.objectives[0]
    names = [objective.name for objective in study.objectives]
    table = tables.full_length_candidates(tables.candidate_table(store, names), study.search.flights == "growing")
    units = {axis.key: axis.unit for axis in study.space.axes}
    bounds = {axis.key: (axis.low, axis.high) for axis in study.space.axes}
    name = study.scenario.name
    figures = {
        "convergence": convergence(table, first.name, maximise=first.maximise, what=name),
        "scatter": fitness_scatter(table, units, first.name, result.parameters, what=name),
    }
    if len(bounds) > 1:
        figures["slices"] = slices(table, bounds, first.name, result.parameters, maximise=first.maximise, what=name)
    if len(names) > 1:
        sound = table.dropna(subset=names).reset_index(drop=True)
        signs = [-1.0 if objective.maximise else 1.0 for objective in study.objectives]
        figures["pareto"] = pareto(sound, pareto_front(sound[names].to_numpy() * signs).tolist(), names, what=name)
    return [save_figure(figure, folder / f"{key}.png") for key, figure in figures.items()]
