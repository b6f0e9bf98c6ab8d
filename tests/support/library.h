/* For programs that load the library of an FMI 3.0 FMU themselves, on Linux, macOS and Windows. Whatever goes wrong ends
   the program with exit status 1 and a line on stderr. */
#ifndef LIBRARY_H
#define LIBRARY_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "fmi3FunctionTypes.h"

#ifdef _WIN32
#include <windows.h>
#else
#include <dlfcn.h>
#endif

static inline void *load(const char *path) {
#ifdef _WIN32
    void *library = (void *)LoadLibraryA(path);
    if (!library) fprintf(stderr, "%s: LoadLibrary error %lu\n", path, GetLastError());
#else
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (!library) fprintf(stderr, "%s\n", dlerror());
#endif
    if (!library) exit(1);
    return library;
}

static inline void *look_up(void *library, const char *name) {
#ifdef _WIN32
    void *symbol = (void *)(uintptr_t)GetProcAddress((HMODULE)library, name);
#else
    void *symbol = dlsym(library, name);
#endif
    if (!symbol) {
        fprintf(stderr, "%s: not found\n", name);
        exit(1);
    }
    return symbol;
}

static inline void check(fmi3Status status, const char *what) {
    if (status == fmi3OK) return;
    fprintf(stderr, "%s: status %d\n", what, (int)status);
    exit(1);
}

static inline void log_message(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category,
                        fmi3String message) {
    (void)environment;
    fprintf(stderr, "%d %s: %s\n", (int)status, category, message);
}

#endif
