# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import (
    attributes as attributes,
    measures as measures,
)
from .attributes import (
    axis_names as axis_names,
    faults_line as faults_line,
    recorded_faults as recorded_faults,
)
from .dataset import (
    DIMENSIONS as DIMENSIONS,
    check_recording as check_recording,
    make_dataset as make_dataset,
    motion_arrays as motion_arrays,
    recording_frames as recording_frames,
)
from .exports import (
    SUFFIXES as SUFFIXES,
    export as export,
)
from .flown_scenario import (
    power_settings as power_settings,
    scenario_of_recording as scenario_of_recording,
)
from .health import doctor as doctor
from .imports import (
    format_words as format_words,
    formats as formats,
)
from .imports.load_tracks import (
    load_tracks as load_tracks,
    read_tracks as read_tracks,
)
from .imports.track import (
    COMMAND_TARGETS as COMMAND_TARGETS,
    POSITION_TARGETS as POSITION_TARGETS,
    VELOCITY_TARGETS as VELOCITY_TARGETS,
    ImportedTrack as ImportedTrack,
    ImportOptions as ImportOptions,
    ImportReport as ImportReport,
)
from .packet_ages import (
    BINS as BINS,
    packet_age as packet_age,
)
from .rare_events import (
    rare_event_notes as rare_event_notes,
    upper_probability_bound as upper_probability_bound,
)
from .reader_process import ReaderProcess as ReaderProcess, refuse_archive as refuse_archive
from .recording_files import (
    load_recording as load_recording,
    replay_recording as replay_recording,
    save as save,
    scenario_to_fly_again as scenario_to_fly_again,
)
from .scores import (
    PAIR_METRICS as PAIR_METRICS,
    PRESENCE_METRICS as PRESENCE_METRICS,
    between_frames_note as between_frames_note,
    body_length_settings as body_length_settings,
    group_scores as group_scores,
    measure_recording as measure_recording,
    missing_lengths_note as missing_lengths_note,
    nearness_note as nearness_note,
    over_time as over_time,
    time_series_names as time_series_names,
    undefined_metrics_of as undefined_metrics_of,
    with_units as with_units,
)
from .simulation import (
    packet_uniforms as packet_uniforms,
    provenance as provenance,
    recording_of as recording_of,
    simulate as simulate,
    to_plain_values as to_plain_values,
)
from .sweeps import (
    fly_sweep as fly_sweep,
    make_sweep as make_sweep,
    metric_to_show as metric_to_show,
    resumed_sweep as resumed_sweep,
)
