/* The composite of a scene of many moving vessels, put together by a loop: tables of what stands where. */
#ifndef VESSEL_LOOP_H
#define VESSEL_LOOP_H

#include "scene.h"

/* Where numbers begin: in p, or in LOOP_HELD, of what the scene holds constant. */
typedef struct {
    int held, at;
} LoopPlace;

/* How a group of vessels hangs on the group before it; INSIDE: by a vessel that is not the first of its group. */
typedef struct {
    enum { FRAME_ROOT, FRAME_FIRST, FRAME_INSIDE } kind;
    int parent;                           /* where that group's pose stands */
    int inside;                           /* in LOOP_HELD: the vessel's pose in the group, of FRAME_INSIDE */
    LoopPlace parent_port, child_port;    /* position, direction, alignment of each */
} LoopFrame;

/* A body of a group: several constant vessels, or one whose mass or moments are inputs; OWN: of the root's group. */
typedef struct {
    enum {
        BODY_FIXED, BODY_SCALED, BODY_FREE, BODY_DIAGONAL, BODY_DIAGONAL_FREE,
        BODY_OWN_FIXED, BODY_OWN_SCALED, BODY_OWN_FREE
    } kind;
    int frame;                            /* where its group's pose stands */
    LoopPlace mass;
    int held;                             /* in LOOP_HELD: the first of its constants */
    LoopPlace moments;                    /* of ..._FREE */
} LoopBody;

/* Numbers of bodies and poses stand LOOP_BLOCK side by side: the next one of the same body is LOOP_BLOCK on. */
extern const LoopFrame LOOP_FRAMES[];
extern const LoopBody LOOP_BODIES[];
extern const double LOOP_HELD[];

#endif
