# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from .executors import (
    Executor as Executor,
    Flight as Flight,
    FlightResult as FlightResult,
    ScoreFunction as ScoreFunction,
)
from .executors.cluster import (
    DaskCluster as DaskCluster,
    ScenarioTask as ScenarioTask,
    check_timeout as check_timeout,
    check_worker_device as check_worker_device,
)
from .executors.in_process import ThreadExecutor as ThreadExecutor
from .executors.scores import score_scenarios as score_scenarios
from .folder import (
    STUDY_FILE as STUDY_FILE,
    Interrupted as Interrupted,
    fingerprint as fingerprint,
    open_folder as open_folder,
    program_versions as program_versions,
    read_toml_file as read_toml_file,
    remove_unfinished as remove_unfinished,
    to_toml_values as to_toml_values,
    write_toml_file as write_toml_file,
)
from .space import (
    SearchAxis as SearchAxis,
    SearchSpace as SearchSpace,
    TiedParameter as TiedParameter,
    declared_numbers as declared_numbers,
    default_scale as default_scale,
    full_space as full_space,
    with_parameters as with_parameters,
)
from .store import (
    CandidateBatch as CandidateBatch,
    FlightStore as FlightStore,
    parse_values as parse_values,
)
