# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from . import (
    agent as agent,
    random as random,
    silence as silence,
)
from .agent import (
    HeardNeighbour as HeardNeighbour,
    State as State,
    decide as decide,
    initial_memory as initial_memory,
    pair_arguments as pair_arguments,
    sum_neighbours as sum_neighbours,
    sum_surfaces as sum_surfaces,
)
from .composition import (
    add_laws as add_laws,
    composition_errors as composition_errors,
)
from .contract import (
    Body as Body,
    Metric as Metric,
    MetricSet as MetricSet,
    Model as Model,
    body as body,
    metric as metric,
    model as model,
    namespace_names as namespace_names,
)
from .contract.declared import (
    CLOCKS as CLOCKS,
    COMMANDS as COMMANDS,
)
from .contract.own_records import initial_values as initial_values
from .fault import (
    DISTURBED_STATES as DISTURBED_STATES,
    ENTRY_KEYS as ENTRY_KEYS,
    FAULT_RULES as FAULT_RULES,
    Fault as Fault,
    fault as fault,
)
from .hearing import (
    PacketPolicy as PacketPolicy,
    extrapolated_state as extrapolated_state,
    packet_counts as packet_counts,
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
from .parameters import (
    Choice as Choice,
    Declaration as Declaration,
    Parameters as Parameters,
    Points as Points,
    Quantity as Quantity,
    Text as Text,
    choice as choice,
    choice_error as choice_error,
    choices as choices,
    declarations as declarations,
    format_with_unit as format_with_unit,
    number_names as number_names,
    points as points,
    points_error as points_error,
    quantity as quantity,
    quantity_error as quantity_error,
    text as text,
)
from .pilot import Pilot as Pilot
from .radio import (
    FEW_PACKETS as FEW_PACKETS,
    PacketParameters as PacketParameters,
    Radio as Radio,
    forward as forward,
)
from .reception import (
    PacketReception as PacketReception,
    arrival_probability as arrival_probability,
    loss_probability as loss_probability,
)
from .rules import law as law
from .rules.integers import (
    resolve_global as resolve_global,
    tree_of as tree_of,
)
from .rules.nodes import walk_tree as walk_tree
from .rules.reading import fields_read as fields_read
from .senses import BoundPercept as BoundPercept
from .sensing import (
    SensorState as SensorState,
    add_errors as add_errors,
    call_measure as call_measure,
)
from .sensor import (
    COMPONENTS as COMPONENTS,
    FIRST_DRAW as FIRST_DRAW,
    Sensor as Sensor,
    SensorParameters as SensorParameters,
    sensor as sensor,
)
from .silence import (
    SilenceParameters as SilenceParameters,
    with_defaults as with_defaults,
)
from .topology import (
    Topology as Topology,
    met_neighbours as met_neighbours,
    topology as topology,
)
from .vectors import (
    component_names as component_names,
    expand_vectors as expand_vectors,
    vector_properties as vector_properties,
    vector_sizes as vector_sizes,
    without_replaced as without_replaced,
)
from .view import AgentView as AgentView
from .vocabulary import (
    PERCEPT_METHODS as PERCEPT_METHODS,
    VOCABULARY as VOCABULARY,
    Mean as Mean,
    Own as Own,
    Percept as Percept,
    argument_names as argument_names,
    call_rule as call_rule,
    radios as radios,
)
from .vocabulary.laws import (
    PAIR as PAIR,
    SURFACE as SURFACE,
)
from .vocabulary.radios import RULES as RULES
