# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from .mavlink import orders as orders
from .mavlink.autopilots import (
    ARMED_FLAG as ARMED_FLAG,
    AUTOPILOTS as AUTOPILOTS,
    px4_mode as px4_mode,
)
from .mavlink.frames import (
    HEADER_LENGTH as HEADER_LENGTH,
    FramePacker as FramePacker,
    FrameStream as FrameStream,
    common_dialect as common_dialect,
    message_fields as message_fields,
)
from .mavlink.messages import (
    CHANNEL_SYSTEM as CHANNEL_SYSTEM,
    HEARS_REPORT as HEARS_REPORT,
    STATUS_MESSAGE as STATUS_MESSAGE,
    TEXT_MESSAGE as TEXT_MESSAGE,
    ChannelReport as ChannelReport,
    DroneStatus as DroneStatus,
    TextPieces as TextPieces,
    parse_report as parse_report,
    parse_status as parse_status,
    report_message as report_message,
    status_message as status_message,
)
from .mavlink.orders import (
    OperatorOrder as OperatorOrder,
    OrderKind as OrderKind,
    new_operator_keys as new_operator_keys,
    parse_order as parse_order,
)
from .mavlink.signing import (
    SIGNING_EPOCH as SIGNING_EPOCH,
    PacketReceiver as PacketReceiver,
    PacketSigner as PacketSigner,
    read_key as read_key,
    write_key as write_key,
)
from .onboard.card import (
    CARD_VERSION as CARD_VERSION,
    FlightCard as FlightCard,
    SafetyLimits as SafetyLimits,
    card_hash as card_hash,
    parse_card as parse_card,
    read_card as read_card,
    to_tuples as to_tuples,
    write_card as write_card,
)
from .onboard.flight_log import (
    code_version as code_version,
    read_log_ticks as read_log_ticks,
    replay_log_file as replay_log_file,
)
from .onboard.mission import (
    AIRBORNE_PHASES as AIRBORNE_PHASES,
    FLYING_PHASES as FLYING_PHASES,
    STANDING_PHASES as STANDING_PHASES,
    MissionPhase as MissionPhase,
)
from .onboard.node import (
    Node as Node,
    NodeOutput as NodeOutput,
)
from .onboard.node_program import (
    Port as Port,
    SerialPort as SerialPort,
    TaskRest as TaskRest,
    TickCounts as TickCounts,
    UdpAddresses as UdpAddresses,
    UdpPort as UdpPort,
    check_port as check_port,
    hand_on_data as hand_on_data,
    main as main,
    open_port as open_port,
    run_alone as run_alone,
    tick_task as tick_task,
)
from .onboard.peers import (
    HEARD_WITHIN as HEARD_WITHIN,
    Peer as Peer,
    Peers as Peers,
)
