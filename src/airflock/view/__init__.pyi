# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import (
    agent_colours as agent_colours,
    plots as plots,
)
from .agent_colours import (
    MOTION_COLOURINGS as MOTION_COLOURINGS,
    AgentColours as AgentColours,
    cluster_distance as cluster_distance,
    cluster_labels as cluster_labels,
    varied_number_units as varied_number_units,
)
from .law_vectors import (
    arrow_lines as arrow_lines,
    rays_and_command as rays_and_command,
    term_name_and_unit as term_name_and_unit,
    vector_values as vector_values,
)
from .order_parameter_plots import (
    flocked as flocked,
    heatmap as heatmap,
)
from .plot_by_kind import (
    naming_file as naming_file,
    plot as plot,
    recording_or_flight as recording_or_flight,
)
from .replay_page import (
    check_colour as check_colour,
    replay as replay,
)
from .result_plots import (
    plot_certificate as plot_certificate,
    plot_identified as plot_identified,
    plot_inferred as plot_inferred,
    plot_why as plot_why,
    stood as stood,
)
from .scene import (
    SceneGeometry as SceneGeometry,
    SceneLines as SceneLines,
    SceneSolid as SceneSolid,
    card_scene as card_scene,
    dart_mesh as dart_mesh,
    scenario_geometry as scenario_geometry,
    velocity_quaternions as velocity_quaternions,
)
from .search_plots import (
    convergence as convergence,
    fitness_scatter as fitness_scatter,
    pareto as pareto,
    slices as slices,
)
from .style import (
    print_settings as print_settings,
    save_figure as save_figure,
)
from .trajectory_plots import (
    rays as rays,
    through as through,
    trajectories as trajectories,
)
from .video_writer import (
    check_chart as check_chart,
    frame_count as frame_count,
    import_ffmpeg as import_ffmpeg,
    video as video,
)
