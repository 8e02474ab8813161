# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import (
    atomic as atomic,
    gpu as gpu,
    locks as locks,
)
from .atomic import (
    PAGES as PAGES,
    PICTURES as PICTURES,
    RECORDINGS as RECORDINGS,
    SCENARIOS as SCENARIOS,
    TABLES as TABLES,
    VIDEOS as VIDEOS,
    atomic_path as atomic_path,
    suffix_error as suffix_error,
)
from .cache import (
    DRIVERS as DRIVERS,
    cache_folder as cache_folder,
    cache_folder_error as cache_folder_error,
    clear_cache as clear_cache,
    default_cache_folder as default_cache_folder,
    list_drivers as list_drivers,
    private_folder as private_folder,
    shrink as shrink,
)
from .coordinates import (
    FlightSite as FlightSite,
    Geodetic as Geodetic,
    swap_enu_ned as swap_enu_ned,
)
from .errors import (
    INVALID as INVALID,
    AirflockError as AirflockError,
    CardError as CardError,
    DeviceError as DeviceError,
    ErrorCollector as ErrorCollector,
    FlightError as FlightError,
    LinkError as LinkError,
    ParameterError as ParameterError,
    RecordingError as RecordingError,
    RuleError as RuleError,
    ScenarioError as ScenarioError,
    SceneError as SceneError,
    StudioError as StudioError,
    StudyError as StudyError,
    check_device as check_device,
    check_precision as check_precision,
    collect_errors as collect_errors,
    describe_error as describe_error,
    invalid_if as invalid_if,
    is_number as is_number,
    os_error_message as os_error_message,
    printable as printable,
    shortened as shortened,
    shortened_lines as shortened_lines,
    suggest as suggest,
    to_identifier as to_identifier,
    value_or_default as value_or_default,
)
from .gpu import (
    cuda_runtime as cuda_runtime,
    free_gpu_memory as free_gpu_memory,
    is_simulated as is_simulated,
    multiprocessor_count as multiprocessor_count,
    require_gpu as require_gpu,
    unavailable_reason as unavailable_reason,
)
from .machine import (
    free_memory as free_memory,
    processor_kind as processor_kind,
    processor_name as processor_name,
    toolchain_versions as toolchain_versions,
    trim_heap as trim_heap,
    vector_bits as vector_bits,
)
from .many_tests import holm_correction as holm_correction
from .rendering import (
    format_cell as format_cell,
    interval_lines as interval_lines,
    log as log,
    result_group as result_group,
    result_table as result_table,
)
from .threads import (
    available_cores as available_cores,
    check_interrupted as check_interrupted,
    run_in_background as run_in_background,
    run_in_threads as run_in_threads,
)
from .untrusted import (
    MAX_BYTES as MAX_BYTES,
    Element as Element,
    FormatError as FormatError,
    TextError as TextError,
    as_error as as_error,
    expand_path as expand_path,
    is_file as is_file,
    parse_json as parse_json,
    parse_json_object as parse_json_object,
    parse_toml as parse_toml,
    parse_toml_value as parse_toml_value,
    parse_xml as parse_xml,
    read_text as read_text,
    read_toml as read_toml,
    to_path as to_path,
)
