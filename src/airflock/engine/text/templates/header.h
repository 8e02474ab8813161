@TITLE@
/* Printed by Airflock from the Python text that flies; SI units. Do not edit it: print it again. */
@NOTES@#ifndef @GUARD@
#define @GUARD@

#ifndef AIRFLOCK_PRECISION
#define AIRFLOCK_PRECISION @PRECISION@
#endif
#ifndef AIRFLOCK_REAL
#define AIRFLOCK_REAL
#if AIRFLOCK_PRECISION == 32
typedef float real;
#define R(number) number##f
#else
typedef double real;
#define R(number) number
#endif
#endif

@DECLARED@
#endif
