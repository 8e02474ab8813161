"""Tasks of a study: what workers of a scheduler are sent, one for each of its scenarios."""

from airflock.engine import score_flight
from airflock.evolve.space import with_parameters
from airflock.evolve.study import Study
from airflock.executors import Score
from airflock.executors.cluster import Task
from airflock.scenarios.scenario import Scenario


class StudyTask(Task):
    """Flies a scenario with the parameters of a candidate."""

    def score_of(self, scenario: Scenario) -> Score:
        """Parameters and seed → order parameters."""
        return lambda p, seed: score_flight(with_parameters(scenario, p), seed, precision=self.precision)


def tasks_of(study: Study) -> tuple[StudyTask, ...]:
    """The task of each scenario of a study; raises StudyError for a law that exists only in this process."""
    return tuple(StudyTask(scenario, int(study.search.precision)) for scenario in study.scenarios)
