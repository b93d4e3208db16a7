/*
 * A layer below cluster.c for its test in .ci/run, by MPI's profiling interface: rank LOST gets SIGKILL or SIGSTOP (the
 * number in LOST_SIGNAL) in the second iteration, when it has sent a shard to one process and not yet to the other.
 *
 *     mpicc cluster.c lost.c ...
 */
#include <mpi.h>
#include <signal.h>
#include <stdlib.h>

#define SECOND_ITERATION 8 /* its first tag */

int MPI_Isend(const void *bytes, int n, MPI_Datatype type, int to, int tag, MPI_Comm comm, MPI_Request *request)
{
    static int sent;
    const char *lost = getenv("LOST"), *number = getenv("LOST_SIGNAL");
    int rank;
    PMPI_Comm_rank(comm, &rank);
    if (lost && number && atoi(lost) == rank && tag >= SECOND_ITERATION && sent++ == 1)
        raise(atoi(number));
    return PMPI_Isend(bytes, n, type, to, tag, comm, request);
}
