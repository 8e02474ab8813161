# What a type checker, an editor and `lazy_loader` read: each public name stands here once.
from .certificates.causes import why as why
from .certificates.certification import certify as certify
from .certificates.disturbances import attack as attack
from .check.models import check_model as check_model, check_types as check_types
from .check.parts import (
    check_body as check_body,
    check_fault as check_fault,
    check_metric as check_metric,
    check_radio as check_radio,
    check_sensor as check_sensor,
    check_topology as check_topology,
)
from .cli.papers import paper as paper
from .core.body import body as body
from .core.fault import fault as fault
from .core.metric import metric as metric
from .core.model import model as model
from .core.parameters import (
    Parameters as Parameters,
    choice as choice,
    quantity as quantity,
)
from .core.radio import radio as radio
from .core.sensor import sensor as sensor
from .displays.shows import display as display
from .engine import Flight as Flight, open_many as open_many, print_law as print_law
from .estimate.identification.vehicle_identification import identify as identify
from .estimate.inference.law_inference import infer as infer
from .fleets.flying import fleet as fleet
from .parts.laws.network import network_weights as network_weights
from .parts.metrics.metric_sets import metric_set as metric_set
from .recordings import measures as measures
from .recordings.exports import export as export
from .recordings.health import doctor as doctor
from .recordings.imports.load_tracks import load_tracks as load_tracks
from .recordings.recording_files import (
    load_recording as load_recording,
    save as save,
)
from .recordings.scores import (
    over_time as over_time,
    score as score,
)
from .recordings.simulation import (
    recording_of as recording_of,
    simulate as simulate,
)
from .recordings.sweeps import sweep as sweep
from .scenarios.files import (
    load as load,
    presets as presets,
)
from .scenarios.keys import keys as keys
from .scenarios.scaling import starting_set as starting_set
from .scenarios.scenario import Scenario as Scenario
from .search.evolution import evolve as evolve, validate as validate
from .search.hardening import harden as harden
from .search.league_table import league as league
from .search.tuning_run import tune as tune
from .studio.live_page import watch as watch
from .support.errors import AirflockError as AirflockError
from .view import plots as plots
from .view.plot_by_kind import plot as plot
from .view.replay_page import replay as replay
from .view.video_writer import video as video

__version__: str
