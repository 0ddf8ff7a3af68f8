/* How the light falls: circles that are lit unevenly are drawn to the bright side unless the fit knows. */
#ifndef TESSERA_FIRMWARE_DETECT_LIGHT_H
#define TESSERA_FIRMWARE_DETECT_LIGHT_H

#include "firmware/detect/marks.h"
#include "firmware/detect/patches.h"
#include "firmware/detect/rim.h"

#define LIGHT_NEAR_MAX 256u

/* A circle and the brightness around it. */
struct light_point {
    int32_t x_px_q16;
    int32_t y_px_q16;
    int32_t level_q30;
};

struct light {
    uint32_t           *near;    /* the circles that are looked at               */
    struct light_point *points;  /* what they say, one colour after the other    */
    int64_t            *off_q30; /* how far each is off the surface; and sorted  */
};

void light_init(struct light *light, struct arena *arena);

/* Sets patch->light from what the first fits say of black and white in the patch and around it: what the surfaces
 * through both do at its anchor, and their distance. Left as it is where there are too few circles. */
void light_find(struct light *light, struct patch *patch, const struct marks *marks);

/* The same by the first `count` circles of light->near, at the given place; false where they are too few. */
bool light_fit(struct light *light, const struct marks *marks, uint32_t count,
               const struct ellipse *place, struct patch_light *out);

/* The slopes of level and contrast for one circle whose contrast has been fitted. */
void light_tilt(const struct patch_light *light, bool white, struct rim_view *view);

#endif
