/* Replays answers of the Python text from which @LAW@ was printed. */
#include "@LAW@.h"

#include <math.h>
#include <stdio.h>

typedef struct { long numbers, others, far; double worst; } Outcome;

static void compare(Outcome *outcome, real found, double expected) {
  const double off = fabs((double)found - expected) / fmax(fabs(expected), 1.0);
  outcome->numbers++;
  if ((double)found != expected) outcome->others++;
  if (!(off <= outcome->worst)) outcome->worst = off;
  if (!(off <= 1e-3)) outcome->far++;
}

@REPLAYS@
static int report(const char *rule, int (*replay)(FILE *, Outcome *), FILE *file) {
  Outcome outcome = {0, 0, 0, 0.0};
  if (!replay(file, &outcome)) return 2;
  printf("%s: %ld numbers, %ld with other bits, %ld far off, largest difference %.1e\n", rule,
         outcome.numbers, outcome.others, outcome.far, outcome.worst);
  /* In single precision a branch may go the other way where two numbers nearly agree. */
  return sizeof(real) == 8 ? outcome.far > 0 || outcome.worst > 1e-12 : outcome.far * 100 > outcome.numbers;
}

int main(int count, char **words) {
  FILE *file = count == 2 ? fopen(words[1], "rb") : 0;
  if (!file) return fprintf(stderr, "usage: test_@LAW@ @LAW@.cases\n"), 2;
  int bad = 0;
@CALLS@
  fclose(file);
  return bad;
}
