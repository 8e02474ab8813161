  real (*ray)(const void *context, real ux, real uy, real uz, real length);
  real (*cast)(const void *context, real ux, real uy, real uz, real length, real radius);
  real (*normal)(const void *context, int draw);
  real (*uniform)(const void *context, int draw);
  const void *context;  /* handed to each of the four; those that the law does not call may be 0 */
