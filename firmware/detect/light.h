/* How the light falls: circles that are lit unevenly are drawn to the bright side unless the fit knows. */
#ifndef TESSERA_FIRMWARE_DETECT_LIGHT_H
#define TESSERA_FIRMWARE_DETECT_LIGHT_H

#include "firmware/detect/marks.h"
#include "firmware/detect/patches.h"
#include "firmware/detect/rim.h"

struct light {
    uint32_t *near;    /* the circles that are looked at */
    int64_t  *off_q30; /* how far each is off the plane  */
};

void light_init(struct light *light, struct arena *arena);

/* Sets patch->light from what the first fits say of black and white in the patch and around it: the slopes
 * of the planes through both. Left as it is where there are too few circles. */
void light_find(struct light *light, struct patch *patch, const struct marks *marks);

/* The slopes of level and contrast for one circle. over_rim_q15: a full swing from black to white over the
 * circle's at its edge. */
void light_tilt(const struct patch_light *light, int64_t over_rim_q15, bool white,
                struct rim_view *view);

#endif
