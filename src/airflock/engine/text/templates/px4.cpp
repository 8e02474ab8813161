/* @LAW@ as a module of PX4: own state from uORB, set-points of velocity for offboard flight.
 * Compiled against declarations written after PX4's headers and messages; neither built with PX4 nor run nor flown.
 * CMakeLists.txt of the module: px4_add_module(MODULE modules__@LAW@ MAIN @LAW@
 *   COMPILE_FLAGS -ffp-contract=off SRCS stub_px4.cpp @LAW@.c)
 */
#include <math.h>
#include <string.h>

#include <drivers/drv_hrt.h>
#include <px4_platform_common/log.h>
#include <px4_platform_common/tasks.h>
#include <px4_platform_common/time.h>
#include <uORB/Publication.hpp>
#include <uORB/Subscription.hpp>
#include <uORB/topics/offboard_control_mode.h>
#include <uORB/topics/trajectory_setpoint.h>
#include <uORB/topics/vehicle_local_position.h>

extern "C" {
#include "@LAW@.h"
}

static volatile bool running = false, leave = false;

static int fly(int, char **) {
  const @LAW@_Parameters numbers = @LAW@_DEFAULTS;
  const @LAW@_Percept percept = {};
  uORB::Subscription position{ORB_ID(vehicle_local_position)};
  uORB::Publication<offboard_control_mode_s> mode{ORB_ID(offboard_control_mode)};
  uORB::Publication<trajectory_setpoint_s> setpoint{ORB_ID(trajectory_setpoint)};
  for (; !leave; px4_usleep(100000)) {
    vehicle_local_position_s at{};
    /* Without set-points PX4 leaves offboard flight: it does what COM_OBL_RC_ACT says. */
    if (!position.copy(&at) || !at.xy_valid || !at.z_valid || !at.v_xy_valid || !at.v_z_valid) continue;
    /* PX4's axes are north, east, down; the law's are east, north, up. */
    const @LAW@_State state = {at.y, at.x, -at.z, at.vy, at.vx, -at.vz};
    @LAW@_Heard heard[1] = {};
    const int who = 0, count = 0; /* TO DO: the own number, and your peers, from a topic of your own */
    const @LAW@_Real3 wish = @LAW@_command(&numbers, &state, who, -1.f, heard, count, nullptr, 0, &percept, 0.1f);
    offboard_control_mode_s offboard{};
    offboard.timestamp = hrt_absolute_time();
    offboard.velocity = true;
    mode.publish(offboard);
    trajectory_setpoint_s wanted{};
    wanted.timestamp = offboard.timestamp;
    for (int i = 0; i < 3; i++) wanted.position[i] = wanted.acceleration[i] = NAN; /* are not controlled */
    wanted.velocity[0] = wish.v1;
    wanted.velocity[1] = wish.v0;
    wanted.velocity[2] = -wish.v2;
    wanted.yaw = NAN;
    setpoint.publish(wanted);
  }
  running = false;
  return 0;
}

extern "C" __EXPORT int @LAW@_main(int count, char **words) {
  if (count == 2 && !strcmp(words[1], "stop")) {
    leave = true;
    return 0;
  }
  if (count != 2 || strcmp(words[1], "start") || running) {
    PX4_INFO("%s", running ? "runs already; @LAW@ stop ends it" : "usage: @LAW@ start|stop");
    return 1;
  }
  leave = false;
  running = px4_task_spawn_cmd("@LAW@", SCHED_DEFAULT, SCHED_PRIORITY_DEFAULT, 3000, fly, nullptr) >= 0;
  return running ? 0 : 1;
}
