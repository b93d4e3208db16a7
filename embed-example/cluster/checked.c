/*
 * A layer below cluster.c for its test in .ci/run, by MPI's profiling interface: every request must be seen to end
 * before MPI_Finalize and before it is used again, and rank 0 sends its first shard twice, the second time in the third
 * iteration: as a process does that was wrong about the death of another. With TAGS of three iterations, the fourth
 * finds it.
 *
 *     mpicc -DTAGS=24 cluster.c checked.c ...
 */
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MOST 4096
#define THIRD_ITERATION 16 /* its first tag */

static MPI_Request *pending[MOST], again = MPI_REQUEST_NULL;
static int count, copied = -1;
static void *copy;

static void forget(MPI_Request *request)
{
    int i;
    for (i = 0; i < count; i++)
        if (pending[i] == request)
            pending[i--] = pending[--count];
}

static void wrong(const char *what)
{
    fprintf(stderr, "checked: %s\n", what);
    PMPI_Abort(MPI_COMM_WORLD, 3);
}

int MPI_Isend(const void *bytes, int n, MPI_Datatype type, int to, int tag, MPI_Comm comm, MPI_Request *request)
{
    int rank, i;
    PMPI_Comm_rank(comm, &rank);
    for (i = 0; i < count; i++)
        if (pending[i] == request)
            wrong("a request is used again before its message has arrived");
    if (count == MOST)
        wrong("too many requests");
    pending[count++] = request;
    if (rank == 0 && copied < 0 && (copy = malloc((size_t)n))) {
        memcpy(copy, bytes, (size_t)n);
        copied = n;
    }
    if (rank == 0 && tag == THIRD_ITERATION && again == MPI_REQUEST_NULL) {
        fprintf(stderr, "checked: sends its first shard again\n");
        PMPI_Isend(copy, copied, type, to, 0, comm, &again);
    }
    return PMPI_Isend(bytes, n, type, to, tag, comm, request);
}

int MPI_Test(MPI_Request *request, int *done, MPI_Status *status)
{
    int result = PMPI_Test(request, done, status);
    if (result == MPI_SUCCESS && *done)
        forget(request);
    return result;
}

int MPI_Finalize(void)
{
    if (count)
        wrong("MPI_Finalize before all messages have arrived");
    PMPI_Wait(&again, MPI_STATUS_IGNORE);
    free(copy);
    return PMPI_Finalize();
}
