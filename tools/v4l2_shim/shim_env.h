/* What tessera-replay tells the preloaded library, through the environment: the names, once. */
#ifndef TESSERA_V4L2_SHIM_SHIM_ENV_H
#define TESSERA_V4L2_SHIM_SHIM_ENV_H

#include "tools/v4l2_shim/folder.h"

#define SHIM_ENV_LIBRARY "libtessera-v4l2-shim.so"
#define SHIM_ENV_FRAMES  "TESSERA_SHIM_FRAMES" /* the folder's absolute path; unset: asleep */
#define SHIM_ENV_DEVICE  "TESSERA_SHIM_DEVICE" /* /dev/videoN                              */
#define SHIM_ENV_FPS     "TESSERA_SHIM_FPS"    /* frames a second; unset: lockstep         */
#define SHIM_ENV_ONCE    "TESSERA_SHIM_ONCE"   /* set: EPIPE after the last frame          */
#define SHIM_ENV_RAW     "TESSERA_SHIM_RAW"    /* fourcc width height stride; unset: PGM   */
#define SHIM_ENV_FAULTS  "TESSERA_SHIM_FAULTS" /* absolute path of the script; unset: no faults  */

struct shim_env {
    const char          *frames; /* NULL: nothing to show                     */
    const char          *device; /* never NULL where frames is not            */
    int                  minor;  /* the device's number                       */
    int64_t              period_ns; /* 0: lockstep                            */
    bool                 once;
    const char          *faults; /* NULL: none                                */
    bool                 raw;
    struct folder_format raw_format;
};

/* The N of /dev/videoN, or -1 where text is not that. */
int shim_env_device_number(const char *text);

/* Nanoseconds from one frame to the next at text frames a second (0.001 .. 100000), or 0 where text
 * is no such number. */
int64_t shim_env_period_ns(const char *text);

/* What the environment says. Strings stay the environment's. */
struct shim_env shim_env_get(void);

/* Puts it into the environment, for the process that exec makes. */
bool shim_env_put(const struct shim_env *settings, const char *fps);

#endif
