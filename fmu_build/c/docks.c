/* Judges which docks are closed: each port once, and no loop. Keeps nothing; needs the table DOCKS. */
#include "docks.h"

#include <string.h>

/* The part that a vessel belongs to, by the number of one of its vessels. */
static int part_of(const int joined[], int vessel) {
    while (joined[vessel] != vessel) vessel = joined[vessel];
    return vessel;
}

/* Adds a closed dock to those before it: each port once, no loop. */
static Status close_dock(Instance *instance, const Dock *closing, const Dock *const closed[], size_t count,
                         int joined[]) {
    for (size_t i = 0; i < count; i++)
        for (size_t k = 0; k < 4; k++)
            if (strcmp(closing->ports[k / 2], closed[i]->ports[k % 2]) == 0)
                return instance_refuse(instance, "%s = true: port %s is docked already, to %s", flag_name(closing),
                                       closing->ports[k / 2], closed[i]->ports[1 - k % 2]);
    const int one = part_of(joined, closing->vessel[0]), other = part_of(joined, closing->vessel[1]);
    if (one == other)
        return instance_refuse(instance, "%s = true: %s - %s closes a loop; %s and %s are joined already",
                               flag_name(closing), closing->ports[0], closing->ports[1], closing->vessels[0],
                               closing->vessels[1]);
    joined[other] = one;
    return STATUS_OK;
}

/* Docks that were closed before come first, so that the one which closes is to blame. */
static int turn_of(const Instance *instance, const Dock *dock, const double p[]) {
    if (dock->flag < 0) return 0;
    if (p[dock->flag] == 0.0) return -1;
    return instance->now.stepped_p[dock->flag] != 0.0 ? 1 : 2;
}

Status docks_check(Instance *instance, const double p[]) {
    const Dock *closed[DOCK_COUNT];
    int joined[VESSEL_COUNT];
    size_t count = 0;
    Status status = STATUS_OK;
    for (int i = 0; i < VESSEL_COUNT; i++) joined[i] = i;
    for (int turn = 0; turn <= 2; turn++)
        for (size_t i = 0; i < DOCK_COUNT && status == STATUS_OK; i++) {
            if (turn_of(instance, &DOCKS[i], p) != turn) continue;
            status = close_dock(instance, &DOCKS[i], closed, count, joined);
            closed[count++] = &DOCKS[i];
        }
    return status;
}
