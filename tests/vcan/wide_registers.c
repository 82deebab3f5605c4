/* Lets user-mode Linux run on processors whose registers it has no room for.
 *
 * With AMX, which Intel's processors have since 2023, the registers of a process take 11 kB. User-mode Linux 6.1 keeps 8 kB
 * of them and sets as many, and the kernel takes all or none: "ptrace set fp regs failed, errno = 14". Preloaded, this sets
 * what user-mode Linux knows and leaves the rest as it is.
 *
 *     cc -O2 -shared -fPIC -o wide_registers.so wide_registers.c -ldl
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <elf.h>
#include <stdarg.h>
#include <stdint.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/uio.h>

typedef long (*ptrace_t)(enum __ptrace_request, ...);

static ptrace_t real_ptrace;

__attribute__((constructor)) static void find_ptrace(void) {
    real_ptrace = (ptrace_t)dlsym(RTLD_NEXT, "ptrace");
}

/* Sets registers of which the caller knows the first part. */
static long set_part(pid_t pid, void *set, struct iovec *known) {
    static char all[1 << 16] __attribute__((aligned(64)));
    struct iovec whole = {all, sizeof all};
    if (real_ptrace(PTRACE_GETREGSET, pid, set, &whole) != 0 || whole.iov_len <= known->iov_len)
        return real_ptrace(PTRACE_SETREGSET, pid, set, known);
    memcpy(all, known->iov_base, known->iov_len);
    return real_ptrace(PTRACE_SETREGSET, pid, set, &whole);
}

long ptrace(enum __ptrace_request request, ...) {
    va_list arguments;
    va_start(arguments, request);
    pid_t pid = va_arg(arguments, pid_t);
    void *address = va_arg(arguments, void *);
    void *data = va_arg(arguments, void *);
    va_end(arguments);
    if (request == PTRACE_SETREGSET && (uintptr_t)address == NT_X86_XSTATE) return set_part(pid, address, data);
    return real_ptrace(request, pid, address, data);
}
