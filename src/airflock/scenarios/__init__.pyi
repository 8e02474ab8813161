# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import (
    cost as cost,
    files as files,
    formats as formats,
    keys as keys,
    schema as schema,
)
from .cost import (
    box_fits_cells as box_fits_cells,
    estimated_seconds as estimated_seconds,
    estimated_total_seconds as estimated_total_seconds,
    largest_fitting as largest_fitting,
    metrics_use_cells as metrics_use_cells,
    run_time_note as run_time_note,
    step_counts as step_counts,
    uses_all_cores as uses_all_cores,
    uses_cells as uses_cells,
)
from .events import (
    Event as Event,
    are_several as are_several,
    check_agent as check_agent,
    check_agents as check_agents,
    check_seed as check_seed,
    check_seeds as check_seeds,
    to_events as to_events,
    to_vector as to_vector,
    to_vectors as to_vectors,
)
from .fault_entries import (
    FaultEntry as FaultEntry,
    FaultOnset as FaultOnset,
    FaultTiming as FaultTiming,
    begun_faults as begun_faults,
    draw_onsets as draw_onsets,
    merge_onsets as merge_onsets,
)
from .files import (
    files_of_laws as files_of_laws,
    load as load,
    load_if_named as load_if_named,
    presets as presets,
    scenario_variant as scenario_variant,
    tells_of_study as tells_of_study,
)
from .flight_world import (
    FlightWorld as FlightWorld,
    GoalCourse as GoalCourse,
    position_error as position_error,
    start_error as start_error,
    wrap_start as wrap_start,
)
from .groups import (
    LETTERS as LETTERS,
    group_names as group_names,
)
from .keys import Key as Key
from .named_code import (
    MODELS as MODELS,
    find_law as find_law,
    import_user_file as import_user_file,
    law_from_caller as law_from_caller,
    law_hash as law_hash,
    user_error_line as user_error_line,
)
from .part_kinds import (
    PART_KINDS as PART_KINDS,
    CallerParts as CallerParts,
    part_from_caller as part_from_caller,
)
from .scaling import starting_set as starting_set
from .scenario import (
    Part as Part,
    Scenario as Scenario,
    format_number as format_number,
    html_table as html_table,
    summary as summary,
)
from .scenario_builder import (
    FIXED_KEYS as FIXED_KEYS,
    build_scenario as build_scenario,
    named_fault_entries as named_fault_entries,
    rebuilt as rebuilt,
    with_faults_starting as with_faults_starting,
    with_settings as with_settings,
)
from .scenario_checks import (
    FORMATIONS as FORMATIONS,
    ground_plan as ground_plan,
    largest_extension as largest_extension,
)
from .schema import value_of as value_of
from .sections import (
    ORDER as ORDER,
    SECTIONS as SECTIONS,
    Flight as Flight,
    Geometry as Geometry,
    StepTimes as StepTimes,
)
from .settings import (
    TOP_LEVEL_KEYS as TOP_LEVEL_KEYS,
    entry_of_key as entry_of_key,
    expand_short_keys as expand_short_keys,
    fault_declarations as fault_declarations,
    fault_key_value as fault_key_value,
    group_declarations as group_declarations,
    group_key_value as group_key_value,
    has_fault as has_fault,
    is_fault_key as is_fault_key,
    is_group_key as is_group_key,
    keys_by_last_word as keys_by_last_word,
    settings_dict as settings_dict,
    split_key as split_key,
    with_old_spread as with_old_spread,
)
