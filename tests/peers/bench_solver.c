/* CHOLMOD on the system that the example `solver` writes.

   Usage: bench_solver SIZE FILE RUNS AMD|METIS|NESDIS SUPERNODAL|SIMPLICIAL. Prints median CPU seconds of analysis with
   factorization and of a solve for two right-hand sides, the bytes of the factor, and the peak resident bytes. */

#include <cholmod.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <time.h>

static double cpu_seconds(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *values, int count)
{
    qsort(values, (size_t)count, sizeof *values, by_size);
    return values[count / 2];
}

static double *read_values(FILE *file, long count)
{
    double *values = malloc((size_t)count * sizeof *values);
    if (!values || fread(values, sizeof *values, (size_t)count, file) != (size_t)count) {
        fprintf(stderr, "the system's file is too short\n");
        exit(1);
    }
    return values;
}

int main(int argc, char **argv)
{
    if (argc != 6) {
        fprintf(stderr, "usage: bench_solver SIZE FILE RUNS ORDERING KIND\n");
        return 2;
    }
    long size = atol(argv[1]), inner = size - 2, edges = (size - 1) * size;
    int runs = atoi(argv[3]);
    FILE *file = fopen(argv[2], "rb");
    if (!file) {
        perror(argv[2]);
        return 1;
    }
    double *across[3], *along[3];
    for (int k = 0; k < 3; k++) {
        across[k] = read_values(file, edges);
        along[k] = read_values(file, edges);
    }
    fclose(file);

    cholmod_common c;
    cholmod_start(&c);
    c.nmethods = 1;
    c.method[0].ordering = !strcmp(argv[4], "AMD") ? CHOLMOD_AMD : !strcmp(argv[4], "METIS") ? CHOLMOD_METIS : CHOLMOD_NESDIS;
    c.supernodal = !strcmp(argv[5], "SUPERNODAL") ? CHOLMOD_SUPERNODAL : CHOLMOD_SIMPLICIAL;
    c.final_ll = 1;
    size_t n = (size_t)(inner * inner);
    cholmod_sparse *a = cholmod_allocate_sparse(n, n, 3 * n, 1, 1, -1, CHOLMOD_REAL, &c);
    cholmod_dense *b = cholmod_zeros(n, 2, CHOLMOD_REAL, &c);
    int *starts = a->p, *indices = a->i, at = 0;
    double *values = a->x, *rhs = b->x;
    for (long row = 1; row <= inner; row++)
        for (long column = 1; column <= inner; column++) {
            long unknown = (row - 1) * inner + column - 1, right = row * (size - 1) + column, down = row * size + column;
            starts[unknown] = at;
            indices[at] = (int)unknown;
            values[at++] = across[0][right - 1] + across[0][right] + along[0][down - size] + along[0][down];
            if (column < inner) {
                indices[at] = (int)unknown + 1;
                values[at++] = -across[0][right];
            }
            if (row < inner) {
                indices[at] = (int)(unknown + inner);
                values[at++] = -along[0][down];
            }
            for (int k = 0; k < 2; k++)
                rhs[(size_t)k * n + (size_t)unknown] =
                    across[k + 1][right - 1] - across[k + 1][right] + along[k + 1][down - size] - along[k + 1][down];
        }
    starts[n] = at;

    double *factoring = calloc((size_t)runs, sizeof *factoring), *solving = calloc((size_t)runs, sizeof *solving);
    double bytes = 0;
    for (int run = 0; run < runs; run++) {
        double start = cpu_seconds();
        cholmod_factor *factor = cholmod_analyze(a, &c);
        if (!cholmod_factorize(a, factor, &c) || c.status != CHOLMOD_OK)
            return 1;
        factoring[run] = cpu_seconds() - start;
        cholmod_dense *x = NULL, *y = NULL, *e = NULL;
        cholmod_solve2(CHOLMOD_A, factor, b, NULL, &x, NULL, &y, &e, &c);
        start = cpu_seconds();
        cholmod_solve2(CHOLMOD_A, factor, b, NULL, &x, NULL, &y, &e, &c);
        solving[run] = cpu_seconds() - start;
        bytes = factor->is_super ? 8.0 * (double)factor->xsize + 4.0 * (double)factor->ssize : 12.0 * (double)factor->nzmax;
        cholmod_free_dense(&x, &c);
        cholmod_free_dense(&y, &c);
        cholmod_free_dense(&e, &c);
        cholmod_free_factor(&factor, &c);
    }
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    printf("{\"factor\": %.6f, \"solve\": %.6f, \"bytes\": %.0f, \"peak\": %.0f}\n", median(factoring, runs), median(solving, runs),
           bytes, 1024.0 * (double)usage.ru_maxrss);
    return 0;
}
