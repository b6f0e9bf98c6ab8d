/* The composite of a scene of many moving vessels, put together by a loop: tables of what stands where. */
#ifndef VESSEL_LOOP_H
#define VESSEL_LOOP_H

#include "scene.h"

/* The place where numbers begin: index `at` of p, or, where `held` is 1, of the scene's constants in LOOP_HELD. */
typedef struct {
    int held, at;
} LoopPlace;

/* How a rigid group of vessels hangs on its parent's group. ROOT: the root's own group, which hangs on nothing. FIRST:
   the parent vessel's axes are those of its group. INSIDE: they are not. */
typedef struct {
    enum { FRAME_ROOT, FRAME_FIRST, FRAME_INSIDE } kind;
    int parent;                           /* where that group's pose stands */
    int inside;                           /* in LOOP_HELD: the vessel's pose in the group, of FRAME_INSIDE */
    LoopPlace parent_port, child_port;    /* position, direction, alignment of each */
} LoopFrame;

/* A body of a group: the constant vessels of the group as one, or a vessel whose mass or moments are inputs. The kinds
   are the steps of these names in supervessel/composite/chain.py; OWN: of the root's own group. */
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

/* Bodies and poses stand LOOP_BLOCK side by side: two numbers of the same body that follow each other are LOOP_BLOCK
   apart. */
extern const LoopFrame LOOP_FRAMES[];
extern const LoopBody LOOP_BODIES[];
extern const double LOOP_HELD[];

#endif
