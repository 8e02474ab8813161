# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import (
    cost as cost,
    files as files,
    formats as formats,
    keys as keys,
    schema as schema,
    short_keys as short_keys,
)
from .cells import (
    box_fits_cells as box_fits_cells,
    metrics_use_cells as metrics_use_cells,
    uses_all_cores as uses_all_cores,
    uses_cells as uses_cells,
)
from .change import (
    FIXED_KEYS as FIXED_KEYS,
    named_fault_entries as named_fault_entries,
    rebuilt as rebuilt,
    scenario_variant as scenario_variant,
    with_faults_starting as with_faults_starting,
    with_settings as with_settings,
)
from .cost import (
    estimated_seconds as estimated_seconds,
    estimated_total_seconds as estimated_total_seconds,
    largest_fitting as largest_fitting,
    run_time_note as run_time_note,
)
from .document import (
    TOP_LEVEL_KEYS as TOP_LEVEL_KEYS,
    settings_dict as settings_dict,
)
from .events import (
    Event as Event,
    are_several as are_several,
    check_agent as check_agent,
    check_agents as check_agents,
    to_events as to_events,
    to_vector as to_vector,
    to_vectors as to_vectors,
)
from .families import (
    BODY_KIND as BODY_KIND,
    METRIC_SET_KIND as METRIC_SET_KIND,
    PART_KINDS as PART_KINDS,
    RADIO_KIND as RADIO_KIND,
    SENSOR_KIND as SENSOR_KIND,
    TOPOLOGY_KIND as TOPOLOGY_KIND,
    CallerParts as CallerParts,
)
from .fault_keys import (
    entry_of_key as entry_of_key,
    fault_declarations as fault_declarations,
    fault_key_value as fault_key_value,
    has_fault as has_fault,
    is_fault_key as is_fault_key,
)
from .faulty import (
    FaultEntry as FaultEntry,
    FaultTiming as FaultTiming,
)
from .files import (
    load as load,
    load_if_named as load_if_named,
    presets as presets,
    tells_of_study as tells_of_study,
)
from .geometry import (
    ground_plan as ground_plan,
    largest_extension as largest_extension,
)
from .group_keys import (
    group_declarations as group_declarations,
    group_key_value as group_key_value,
    is_group_key as is_group_key,
    split_key as split_key,
    with_old_spread as with_old_spread,
)
from .groups import (
    LETTERS as LETTERS,
    group_names as group_names,
)
from .keys import Key as Key
from .laws import (
    MODELS as MODELS,
    find_law as find_law,
    law_from_caller as law_from_caller,
)
from .making import build_scenario as build_scenario
from .onsets import (
    FaultOnset as FaultOnset,
    begun_faults as begun_faults,
    draw_onsets as draw_onsets,
    merge_onsets as merge_onsets,
)
from .own_code import (
    import_user_file as import_user_file,
    law_hash as law_hash,
    user_error_line as user_error_line,
)
from .places import (
    position_error as position_error,
    start_error as start_error,
    wrap_start as wrap_start,
)
from .portrait import (
    format_number as format_number,
    html_table as html_table,
    summary as summary,
)
from .scaling import starting_set as starting_set
from .scenario import Scenario as Scenario
from .schema import value_of as value_of
from .sections import (
    ORDER as ORDER,
    SECTIONS as SECTIONS,
    Flight as Flight,
    Geometry as Geometry,
    StepTimes as StepTimes,
)
from .seeds import (
    check_seed as check_seed,
    check_seeds as check_seeds,
)
from .short_keys import expand_short_keys as expand_short_keys
from .surroundings import (
    FlightWorld as FlightWorld,
    GoalCourse as GoalCourse,
)
from .timing import step_counts as step_counts
from .wings import FORMATIONS as FORMATIONS
