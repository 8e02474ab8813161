/* @LAW@ on a bare microcontroller: a loop that decides ten times a second. Compiled for a Cortex-M4, not run.
 * The four functions below are yours: they read a clock, the own state and the radio, and send a set-point.
 */
#include "@LAW@.h"

#define FLOCK 30
#define PERIOD R(0.1)

extern unsigned milliseconds(void);
extern @LAW@_State own_state(void);
extern int heard_now(@LAW@_Heard *heard, int most);
extern void send_setpoint(real x, real y, real z);

int main(void) {
  const @LAW@_Parameters numbers = @LAW@_DEFAULTS;
  const @LAW@_Percept percept = {0};
  const int who = 0;  /* TO DO: each drone's own number */
  unsigned due = milliseconds();
  for (;;) {
    while ((int)(milliseconds() - due) < 0) {
    }
    due += 100u;
    @LAW@_Heard heard[FLOCK];
    const int count = heard_now(heard, FLOCK);
    const @LAW@_State state = own_state();
    const @LAW@_Real3 wish =
        @LAW@_command(&numbers, &state, who, R(-1.0), heard, count, 0, 0, &percept, PERIOD);
    send_setpoint(wish.v0, wish.v1, wish.v2);
  }
}
