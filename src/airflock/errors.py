"""All errors that Airflock raises on purpose: one line each, ready for a person to read."""


class AirflockError(Exception):
    """Root of every error that the command line prints as one line before it exits with status 2."""


class ParameterError(AirflockError):
    """A number, a choice or a key is not acceptable; names key, value, unit and allowed range."""


class ScenarioError(AirflockError):
    """A scenario file or a set of its keys cannot be used; carries every fault that was found, one line each."""

    def __init__(self, faults: list[str]):
        self.faults = ["".join(c if c.isprintable() else repr(c)[1:-1] for c in fault) for fault in faults]
        super().__init__("\n".join(self.faults))


class RuleError(AirflockError):
    """A rule breaks the contract of `airflock.core.contract`."""


class RecordingError(AirflockError):
    """A file or a dataset is no recording, or cannot be written."""


class FlightError(AirflockError):
    """A flight could not be started or went wrong: says which world, agent and step."""


class SceneError(AirflockError):
    """A scene cannot be used: a mesh that is open, inverted, in a wrong unit or damaged, or one without free room."""


class DeviceError(AirflockError):
    """A device cannot be used, or not for this flight: says why, how much memory is needed and what fits."""


class StudyError(AirflockError):
    """A study's folder cannot be used: another study's, another version's, or in use; or an executor is missing."""


class StudioError(AirflockError):
    """A page cannot be opened: its port is in use, or there is nothing to show."""
