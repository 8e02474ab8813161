# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from .dask_cluster import (
    check_timeout as check_timeout,
    check_worker_device as check_worker_device,
)
from .executors import (
    Executor as Executor,
    Flight as Flight,
    FlightResult as FlightResult,
    OnProgress as OnProgress,
    ProgressTally as ProgressTally,
    RunProgress as RunProgress,
    ScenarioTask as ScenarioTask,
    ThreadExecutor as ThreadExecutor,
    make_executor as make_executor,
    score_scenarios as score_scenarios,
)
from .flight_store import (
    CandidateBatch as CandidateBatch,
    FlightStore as FlightStore,
    parse_values as parse_values,
)
from .folder import (
    REQUEST_FILE as REQUEST_FILE,
    RESULT_FILE as RESULT_FILE,
    Interrupted as Interrupted,
    differences as differences,
    fingerprint as fingerprint,
    held_request as held_request,
    list_differences as list_differences,
    open_folder as open_folder,
    open_run as open_run,
    program_versions as program_versions,
    read_request as read_request,
    read_toml_file as read_toml_file,
    requested_scenario as requested_scenario,
    run_folder as run_folder,
    run_place as run_place,
    to_toml_values as to_toml_values,
    unpublished as unpublished,
    write_toml_file as write_toml_file,
)
from .search_space import (
    SearchAxis as SearchAxis,
    SearchSpace as SearchSpace,
    TiedParameter as TiedParameter,
    declared_numbers as declared_numbers,
    default_scale as default_scale,
    full_space as full_space,
    with_parameters as with_parameters,
)
