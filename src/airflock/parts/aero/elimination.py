"""Dense linear systems in place: one factorisation with partial pivoting, then any number of right-hand sides."""


def factorise(a, pivots, n):
    """Replace the n x n matrix `a` by its factors L and U; pivots[0][k] is the row that was swapped into place k."""
    for k in range(n):
        best = k
        for i in range(k, n):
            if abs(a[i][k]) > abs(a[best][k]):
                best = i
        pivots[0][k] = float(best)
        for j in range(n):
            kept = a[k][j]
            a[k][j] = a[best][j]
            a[best][j] = kept
        for i in range(k + 1, n):
            a[i][k] = a[i][k] / a[k][k]
            for j in range(k + 1, n):
                a[i][j] = a[i][j] - a[i][k] * a[k][j]


def substitute(a, pivots, b, row, n):
    """Solve a x = b for one right-hand side, the row `row` of b, which becomes x; `a` and pivots from `factorise`."""
    for k in range(n):
        j = int(pivots[0][k])
        kept = b[row][k]
        b[row][k] = b[row][j]
        b[row][j] = kept
    for i in range(n):
        s = b[row][i]
        for k in range(i):
            s = s - a[i][k] * b[row][k]
        b[row][i] = s
    for e in range(n):
        i = n - 1 - e
        s = b[row][i]
        for k in range(i + 1, n):
            s = s - a[i][k] * b[row][k]
        b[row][i] = s / a[i][i]


def substitute_transposed(a, pivots, b, row, n):
    """Substitute with the transposed matrix."""
    for i in range(n):
        s = b[row][i]
        for k in range(i):
            s = s - a[k][i] * b[row][k]
        b[row][i] = s / a[i][i]
    for e in range(n):
        i = n - 1 - e
        s = b[row][i]
        for k in range(i + 1, n):
            s = s - a[k][i] * b[row][k]
        b[row][i] = s
    for e in range(n):
        k = n - 1 - e
        j = int(pivots[0][k])
        kept = b[row][k]
        b[row][k] = b[row][j]
        b[row][j] = kept


def invert_definite(a, n):
    """Replace the positive definite n x n matrix in the left half of `a` (n, 2 n) by its inverse in the right half."""
    for i in range(n):
        for j in range(n):
            a[i][n + j] = 1.0 if i == j else 0.0
    for k in range(n):
        f = 1.0 / a[k][k]
        for j in range(2 * n):
            a[k][j] = a[k][j] * f
        for i in range(n):
            if i != k:
                f = a[i][k]
                for j in range(2 * n):
                    a[i][j] = a[i][j] - f * a[k][j]
