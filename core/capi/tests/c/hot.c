/*
 * All that a program calls while it renders. `.ci/run c` links it against a library in which panics end in a function that
 * does not exist: it links only if none of these calls can reach a panic. Calls reach the tracers through the session, so
 * that the linker would leave them out: it is told to link croupier_session_init and croupier_session_init_with, too, and the
 * step looks for the tracers in the program.
 */
#include <croupier.h>

static char memory[1 << 20];

int main(void)
{
    croupier_session *session = (croupier_session *)(void *)memory;
    croupier_shard *shard = (croupier_shard *)(void *)memory;
    croupier_work work = {.struct_size = sizeof work};
    uint32_t more = 0;
    croupier_session_next_samples(session, CROUPIER_TARGET_SECONDS, 1.0, 0.0, &work, &more, 0);
    croupier_session_begin_iteration(session, 1, 0);
    croupier_shard_step(shard, session, 1, &more, 0);
    croupier_shard_stop(shard, 0);
    croupier_session_finish_iteration(session, &shard, 1, 1, &more, 0);
    croupier_session_rgb(session, (float *)(void *)memory, 3, 0);
    return (int)more;
}
