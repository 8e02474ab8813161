/* @LAW@ as a module of PX4: own state from uORB, set-points of velocity for offboard flight.
 * Written from PX4's documentation; neither compiled with it nor flown. Peers must come by a topic of your own.
 */
#include <px4_platform_common/px4_config.h>
#include <px4_platform_common/module.h>
#include <px4_platform_common/time.h>
#include <uORB/Publication.hpp>
#include <uORB/Subscription.hpp>
#include <uORB/topics/offboard_control_mode.h>
#include <uORB/topics/trajectory_setpoint.h>
#include <uORB/topics/vehicle_local_position.h>

extern "C" {
#include "@LAW@.h"
}

extern "C" __EXPORT int @LAW@_main(int, char **) {
  const @LAW@_Parameters numbers = @LAW@_DEFAULTS;
  const @LAW@_Percept percept = {};
  uORB::Subscription position{ORB_ID(vehicle_local_position)};
  uORB::Publication<offboard_control_mode_s> mode{ORB_ID(offboard_control_mode)};
  uORB::Publication<trajectory_setpoint_s> setpoint{ORB_ID(trajectory_setpoint)};
  for (;;) {
    vehicle_local_position_s at;
    if (position.copy(&at) && at.xy_valid && at.v_xy_valid) {
      /* PX4's axes are north, east, down; the law's are east, north, up. */
      const @LAW@_State state = {at.y, at.x, -at.z, at.vy, at.vx, -at.vz};
      @LAW@_Heard heard[1];
      const int count = 0; /* TO DO: your peers */
      const @LAW@_Real3 wish = @LAW@_command(&numbers, &state, 0, -1.f, heard, count, nullptr, 0, &percept, 0.1f);
      offboard_control_mode_s offboard{};
      offboard.timestamp = hrt_absolute_time();
      offboard.velocity = true;
      mode.publish(offboard);
      trajectory_setpoint_s wanted{};
      wanted.timestamp = offboard.timestamp;
      wanted.position[0] = wanted.position[1] = wanted.position[2] = NAN;
      wanted.velocity[0] = wish.v1;
      wanted.velocity[1] = wish.v0;
      wanted.velocity[2] = -wish.v2;
      wanted.yaw = NAN;
      setpoint.publish(wanted);
    }
    px4_usleep(100000);
  }
}
