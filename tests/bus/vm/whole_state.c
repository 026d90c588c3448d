/* Preloaded into User-Mode Linux, so that it boots on a host whose processor keeps more state than it knows of.
 *
 * User-Mode Linux 6.1 keeps 2,696 bytes of a process's extended state (FP_SIZE of arch/um); AMX alone adds 8,192. The
 * host's ptrace takes a state back whole or not at all (PTRACE_SETREGSET, NT_X86_XSTATE), so a part that is set is
 * completed here with the rest of what the process has. How much that is the host says.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

#define XSTATE 0x202 /* NT_X86_XSTATE of elf.h */

typedef long call(int, pid_t, void *, void *);

/* The whole state of the process, `all->iov_len` its size; 0 where the host does not give it. */
static int read_whole(call *next, pid_t pid, struct iovec *all)
{
    static char *room;
    static size_t size = 4096;
    for (;; size *= 2) {
        if (!(room = realloc(room, size)))
            return 0;
        all->iov_base = room;
        all->iov_len = size;
        if (next(PTRACE_GETREGSET, pid, (void *)XSTATE, all) != 0)
            return 0;
        if (all->iov_len < size)
            return 1;
    }
}

long ptrace(enum __ptrace_request request, ...)
{
    static call *next;
    va_list list;
    va_start(list, request);
    pid_t pid = va_arg(list, pid_t);
    void *address = va_arg(list, void *), *data = va_arg(list, void *);
    va_end(list);
    if (!next)
        next = (call *)dlsym(RTLD_NEXT, "ptrace");
    if (request == PTRACE_SETREGSET && (long)address == XSTATE) {
        struct iovec *part = data, all;
        if (read_whole(next, pid, &all) && part->iov_len < all.iov_len) {
            memcpy(all.iov_base, part->iov_base, part->iov_len);
            return next(request, pid, address, &all);
        }
    }
    return next(request, pid, address, data);
}
