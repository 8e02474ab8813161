/* @LAW@ in an app of the Crazyflie firmware: peers' states by peer-to-peer radio, set-points of velocity.
 * Compiled against the firmware's headers (August 2026); neither linked with it nor run nor flown. Copy @LAW@.c and
 * @LAW@.h beside it. It sends set-points only while the parameter flock.fly is 1.
 */
#include <string.h>

#include "FreeRTOS.h"
#include "app.h"
#include "commander.h"
#include "configblock.h"
#include "log.h"
#include "param.h"
#include "radiolink.h"
#include "task.h"

#include "@LAW@.h"

#define FLOCK 10         /* drones; the last byte of the radio address is the number, from 0 to FLOCK - 1 */
#define PERIOD_MS 100
#define FORGET_MS 1000   /* a peer that has been silent for so long counts no more */
#define HEIGHT 1.0f      /* m; it is held, and what the law commands upwards is not flown */

typedef struct {
  uint8_t who;
  float x, y, z, vx, vy, vz;
} __attribute__((packed)) Packet;

static @LAW@_Heard heard[FLOCK];
static TickType_t heard_at[FLOCK];
static uint8_t fly;

PARAM_GROUP_START(flock)
PARAM_ADD(PARAM_UINT8, fly, &fly)
PARAM_GROUP_STOP(flock)

static void receive(P2PPacket *packet) {
  Packet peer;
  if (packet->size != sizeof peer) return;
  memcpy(&peer, packet->data, sizeof peer);
  if (peer.who >= FLOCK) return;
  taskENTER_CRITICAL();  /* the app's task reads them, too */
  heard[peer.who] = (@LAW@_Heard){{peer.x, peer.y, peer.z, peer.vx, peer.vy, peer.vz}, 0.0f, peer.who, -1.0f};
  heard_at[peer.who] = xTaskGetTickCount();
  taskEXIT_CRITICAL();
}

void appMain(void) {
  const @LAW@_Parameters numbers = @LAW@_DEFAULTS;
  const uint8_t who = (uint8_t)(configblockGetRadioAddress() & 0xff);
  const logVarId_t places[6] = {
      logGetVarId("stateEstimate", "x"), logGetVarId("stateEstimate", "y"), logGetVarId("stateEstimate", "z"),
      logGetVarId("stateEstimate", "vx"), logGetVarId("stateEstimate", "vy"), logGetVarId("stateEstimate", "vz")};
  bool flying = false;
  p2pRegisterCB(receive);
  for (;;) {
    vTaskDelay(M2T(PERIOD_MS));
    float v[6];
    for (int i = 0; i < 6; i++) v[i] = logGetFloat(places[i]);
    const Packet own = {who, v[0], v[1], v[2], v[3], v[4], v[5]};
    P2PPacket packet = {.port = 0, .size = sizeof own};
    memcpy(packet.data, &own, sizeof own);
    radiolinkSendP2PPacketBroadcast(&packet);

    @LAW@_Heard near[FLOCK];
    int count = 0;
    taskENTER_CRITICAL();
    for (int i = 0; i < FLOCK; i++) {
      const TickType_t age = xTaskGetTickCount() - heard_at[i];
      if (i == who || heard_at[i] == 0 || age > M2T(FORGET_MS)) continue;
      near[count] = heard[i];
      near[count++].age = (float)age / (float)configTICK_RATE_HZ;
    }
    taskEXIT_CRITICAL();
    if (!fly || who >= FLOCK) {  /* peers ignore a number that is too large, so such a drone stays down */
      if (flying) commanderRelaxPriority();
      flying = false;
      continue;
    }
    flying = true;
    const @LAW@_State state = {v[0], v[1], v[2], v[3], v[4], v[5]};
    const @LAW@_Percept percept = {0};
    /* TO DO: the surfaces of your room; take-off, landing and what ends the flight are yours, too. */
    const @LAW@_Real3 wish = @LAW@_command(&numbers, &state, who, -1.0f, near, count, 0, 0, &percept, PERIOD_MS / 1000.0f);
    setpoint_t setpoint = {0};
    setpoint.mode.x = setpoint.mode.y = modeVelocity;
    setpoint.mode.z = modeAbs;
    setpoint.mode.yaw = modeVelocity;
    setpoint.velocity.x = wish.v0;
    setpoint.velocity.y = wish.v1;
    setpoint.position.z = HEIGHT;
    commanderSetSetpoint(&setpoint, 3);
  }
}
