/* Preloaded before the address sanitizer's runtime, which refuses libraries that bind their own symbols first, as
   CasADi loads its plugins: takes that flag away. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <string.h>

void *dlopen(const char *name, int flags) {
    static void *(*next)(const char *, int);
    if (!next) {
        void *symbol = dlsym(RTLD_NEXT, "dlopen");
        memcpy(&next, &symbol, sizeof next);
    }
    return next(name, flags & ~RTLD_DEEPBIND);
}
