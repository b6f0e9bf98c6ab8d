/* The composite of a scene of many moving vessels, put together by a loop: tables of what stands where. */
#ifndef LOOP_H
#define LOOP_H

#include "scene.h"

/* An index >= 0 is a place in p; ~index is one in LOOP_HELD, of what the scene holds constant. */

/* How a group of vessels hangs on the group before it; INSIDE: by a vessel that is not the first of its group. */
typedef struct {
    enum { FRAME_ROOT, FRAME_FIRST, FRAME_INSIDE } kind;
    int parent;                           /* number of that group's frame */
    int inside;                           /* the vessel's pose in the group, of FRAME_INSIDE */
    int parent_port, child_port;          /* position, direction, alignment of each */
} LoopFrame;

/* A body of a group: several constant vessels, or one whose mass or moments are inputs; OWN: of the root's group. */
typedef struct {
    enum { BODY_FIXED, BODY_SCALED, BODY_FREE, BODY_DIAGONAL, BODY_OWN_FIXED, BODY_OWN_SCALED, BODY_OWN_FREE } kind;
    int frame, mass, held, moments;
} LoopBody;

extern const LoopFrame LOOP_FRAMES[];
extern const LoopBody LOOP_BODIES[];
extern const double LOOP_HELD[];

#endif
