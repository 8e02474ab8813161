"""Pictures of a finished study, drawn into its folder."""

from pathlib import Path

from airflock.runs.store import Store
from airflock.search import tables
from airflock.search.nondominated import front
from airflock.search.result import Result
from airflock.search.study import Study


def draw(study: Study, store: Store, result: Result, folder: Path) -> list[Path]:
    """Convergence, fitness against parameters, pairwise slices; with several objectives the front."""
    from airflock.view.plots.convergence import convergence
    from airflock.view.plots.fitness_scatter import fitness_scatter
    from airflock.view.plots.pareto import pareto
    from airflock.view.plots.save import save_figure
    from airflock.view.plots.slices import slices

    first = study.objectives[0]
    names = [objective.name for objective in study.objectives]
    table = tables.whole_flights(tables.candidates(store, names), study.search.flights == "growing")
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
        figures["pareto"] = pareto(sound, front(sound[names].to_numpy() * signs).tolist(), names, what=name)
    return [save_figure(figure, folder / f"{key}.png") for key, figure in figures.items()]
