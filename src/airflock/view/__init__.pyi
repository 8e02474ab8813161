# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import plots as plots
from .plots.certificate import plot_certificate as plot_certificate
from .plots.convergence import convergence as convergence
from .plots.display import stood as stood
from .plots.film_stage import check_chart as check_chart
from .plots.fitness_scatter import fitness_scatter as fitness_scatter
from .plots.flocked import flocked as flocked
from .plots.heatmap import heatmap as heatmap
from .plots.identified import plot_identified as plot_identified
from .plots.inferred import plot_inferred as plot_inferred
from .plots.pareto import pareto as pareto
from .plots.picture import (
    naming_file as naming_file,
    plot as plot,
    recording_or_flight as recording_or_flight,
)
from .plots.rays import rays as rays
from .plots.save import (
    print_settings as print_settings,
    save_figure as save_figure,
)
from .plots.scene_paths import through as through
from .plots.slices import slices as slices
from .plots.trajectories import trajectories as trajectories
from .plots.video import (
    frame_count as frame_count,
    import_ffmpeg as import_ffmpeg,
    video as video,
)
from .replays.build import (
    check_colour as check_colour,
    replay as replay,
)
from .stage import (
    colours as colours,
    shades as shades,
)
from .stage.arrows import (
    arrow_lines as arrow_lines,
    term_name_and_unit as term_name_and_unit,
    vector_values as vector_values,
)
from .stage.clusters import (
    cluster_distance as cluster_distance,
    cluster_labels as cluster_labels,
)
from .stage.field import card_scene as card_scene
from .stage.rays import rays_and_command as rays_and_command
from .stage.scene import (
    SceneGeometry as SceneGeometry,
    SceneLines as SceneLines,
    SceneSolid as SceneSolid,
    dart_mesh as dart_mesh,
    scenario_geometry as scenario_geometry,
    velocity_quaternions as velocity_quaternions,
)
from .stage.shades import (
    MOTION_COLOURINGS as MOTION_COLOURINGS,
    AgentColours as AgentColours,
    varied_number_units as varied_number_units,
)
