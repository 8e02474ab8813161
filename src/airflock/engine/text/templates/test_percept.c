static real ray(const void *context, real ux, real uy, real uz, real length) {
  (void)context; (void)uz;
  return R(0.8) * ux + R(0.6) * uy > R(0.3) ? length : R(0.5) * length;
}

static real cast(const void *context, real ux, real uy, real uz, real length, real radius) {
  (void)radius;
  return ray(context, ux, uy, uz, length);
}

static real normal(const void *context, int draw) {
  (void)context;
  return R(0.25) * (real)draw - R(0.75);
}

static real uniform(const void *context, int draw) {
  (void)context;
  return R(0.125) + R(0.03125) * (real)draw;
}
