# The door: what other rooms may use. `lazy_loader` and type checkers read it here; the rest is private to the room.
from .mavlink import (
    dialect as dialect,
    orders as orders,
    status as status,
    witness as witness,
)
from .mavlink.autopilots import (
    ARMED_FLAG as ARMED_FLAG,
    AUTOPILOTS as AUTOPILOTS,
    px4_mode as px4_mode,
)
from .mavlink.frames import (
    HEADER_LENGTH as HEADER_LENGTH,
    FramePacker as FramePacker,
    FrameStream as FrameStream,
)
from .mavlink.keys import (
    read_key as read_key,
    write_key as write_key,
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
)
from .mavlink.status import (
    STATUS_MESSAGE as STATUS_MESSAGE,
    DroneStatus as DroneStatus,
    parse_status as parse_status,
    status_message as status_message,
)
from .onboard.card import (
    CARD_VERSION as CARD_VERSION,
    FlightCard as FlightCard,
    card_hash as card_hash,
    parse_card as parse_card,
    read_card as read_card,
    write_card as write_card,
)
from .onboard.fields import to_tuples as to_tuples
from .onboard.log import (
    read_log_ticks as read_log_ticks,
    replay_log_file as replay_log_file,
)
from .onboard.mission import (
    AIRBORNE_PHASES as AIRBORNE_PHASES,
    FLYING_PHASES as FLYING_PHASES,
    MissionPhase as MissionPhase,
)
from .onboard.node import (
    Node as Node,
    NodeOutput as NodeOutput,
)
from .onboard.peers import (
    HEARD_WITHIN as HEARD_WITHIN,
    Peer as Peer,
    Peers as Peers,
)
from .onboard.ports import (
    Port as Port,
    SerialPort as SerialPort,
    UdpAddresses as UdpAddresses,
    UdpPort as UdpPort,
    check_port as check_port,
    open_port as open_port,
)
from .onboard.resting import (
    TaskRest as TaskRest,
    hand_on_data as hand_on_data,
    run_alone as run_alone,
)
from .onboard.run import (
    TickCounts as TickCounts,
    main as main,
    tick_task as tick_task,
)
from .onboard.safety import SafetyLimits as SafetyLimits
