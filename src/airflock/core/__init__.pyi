# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import agent as agent, law as law, radio as radio, random as random, silence as silence
from .agent import (
    AgentView as AgentView,
    BoundPercept as BoundPercept,
    HeardNeighbour as HeardNeighbour,
    decide as decide,
    initial_memory as initial_memory,
    met_neighbours as met_neighbours,
    pair_arguments as pair_arguments,
    sum_neighbours as sum_neighbours,
    sum_surfaces as sum_surfaces,
)
from .body import Body as Body, BodyParameters as BodyParameters, body as body, first_command as first_command
from .contract import (
    CLOCKS as CLOCKS,
    COMMANDS as COMMANDS,
    Kind as Kind,
    State as State,
    argument_names as argument_names,
    call_rule as call_rule,
    initial_values as initial_values,
    installed as installed,
    namespace_names as namespace_names,
)
from .fault import (
    DISTURBED_STATES as DISTURBED_STATES,
    ENTRY_KEYS as ENTRY_KEYS,
    FAULT_RULES as FAULT_RULES,
    Fault as Fault,
    fault as fault,
)
from .law import (
    bound_values as bound_values,
    fields_read as fields_read,
    resolve_global as resolve_global,
    text_state as text_state,
    tree_of as tree_of,
    walk_tree as walk_tree,
)
from .maths import (
    FAR as FAR,
    TINY as TINY,
    angle_between as angle_between,
    arc_cosine as arc_cosine,
    bell as bell,
    braking_curve as braking_curve,
    braking_distance as braking_distance,
    clamp as clamp,
    excess as excess,
    norm as norm,
    peak as peak,
    rising as rising,
    shorten as shorten,
    unit as unit,
)
from .metric import Metric as Metric, MetricSet as MetricSet, metric as metric
from .model import (
    PAIR as PAIR,
    SURFACE as SURFACE,
    Model as Model,
    add_laws as add_laws,
    composition_errors as composition_errors,
    model as model,
    steered_law as steered_law,
)
from .parameters import (
    Choice as Choice,
    Declaration as Declaration,
    Parameters as Parameters,
    Points as Points,
    Quantity as Quantity,
    Text as Text,
    choice as choice,
    choices as choices,
    column as column,
    column_places as column_places,
    component_names as component_names,
    declarations as declarations,
    expand_vectors as expand_vectors,
    format_with_unit as format_with_unit,
    number_names as number_names,
    points as points,
    quantity as quantity,
    quantity_error as quantity_error,
    telling_digits as telling_digits,
    text as text,
    vector_properties as vector_properties,
    vector_sizes as vector_sizes,
    without_replaced as without_replaced,
)
from .pilot import (
    PacketPolicy as PacketPolicy,
    Pilot as Pilot,
    extrapolated_state as extrapolated_state,
    packet_counts as packet_counts,
)
from .radio import (
    FEW_PACKETS as FEW_PACKETS,
    RULES as RULES,
    PacketParameters as PacketParameters,
    PacketReception as PacketReception,
    Radio as Radio,
    arrival_probability as arrival_probability,
    forward as forward,
    loss_probability as loss_probability,
)
from .sensor import (
    COMPONENTS as COMPONENTS,
    FIRST_DRAW as FIRST_DRAW,
    Sensor as Sensor,
    SensorParameters as SensorParameters,
    SensorState as SensorState,
    add_errors as add_errors,
    call_measure as call_measure,
    sensor as sensor,
)
from .silence import (
    SilenceParameters as SilenceParameters,
    with_defaults as with_defaults,
)
from .topology import Topology as Topology, topology as topology
from .vocabulary import (
    PERCEPT_METHODS as PERCEPT_METHODS,
    VOCABULARY as VOCABULARY,
    Mean as Mean,
    Own as Own,
    Percept as Percept,
)
