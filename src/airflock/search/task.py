"""Tasks of a study: what workers of a scheduler are sent, one for each of its scenarios."""

from airflock.engine import score_flight
from airflock.runs import ScenarioTask, ScoreFunction, with_parameters
from airflock.scenarios import Scenario
from airflock.search.study import Study


class StudyTask(ScenarioTask):
    """Flies a scenario with the parameters of a candidate."""

    def score_function(self, scenario: Scenario) -> ScoreFunction:
        """Parameters and seed → order parameters."""
        return lambda p, seed: score_flight(with_parameters(scenario, p), seed, precision=self.precision)


def study_tasks(study: Study) -> tuple[StudyTask, ...]:
    """The task of each scenario of a study; raises StudyError for a law that exists only in this process."""
    return tuple(StudyTask(scenario, int(study.search.precision)) for scenario in study.scenarios)
