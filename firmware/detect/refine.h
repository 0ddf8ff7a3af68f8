/* Every named circle gets its last place, by the fit of circlefit.h, with what only all of them together know:
 * where the triangles' edges lie and how sharp they are (pattern.h), how the light falls (light.h), and how noisy
 * the frame is. A circle that is noisier than the frame, or on one side, has something in front of it and is
 * refused. */
#ifndef TESSERA_FIRMWARE_DETECT_REFINE_H
#define TESSERA_FIRMWARE_DETECT_REFINE_H

#include "firmware/detect/boardmap.h"
#include "firmware/detect/circlefit.h"
#include "firmware/detect/light.h"
#include "firmware/detect/pattern.h"

struct refine {
    struct circlefit fit;
    struct light light;
    struct boardmap_pair *pairs; /* of one patch                  */
    struct rim_view *views;      /* of its features, by index     */
    int32_t   blur_px_q16;       /* typical of the frame; 0 when nothing was refined */
    int32_t   edge_blur_px_q16;  /* the same of large circles, for straight edges    */
    int64_t   noise_max_q16;     /* largest noise that counts, of 4096 grey_q4,      */
    int64_t   worst_max_q16;     /* largest of one eighth of the rim,                */
    int64_t   slack_q16;         /* and what the model leaves, over contrast         */
    uint32_t  refined;           /* counters of the frame */
    uint32_t  refused;
};

void refine_init(struct refine *refine, struct arena *arena, const struct dsp_kernels *dsp,
                 const struct patches_settings *settings, uint32_t kernel_sigma_px_q16);

/* How wide the filters were that the next marks' edges went through, in pixels of the frame. */
void refine_set_kernel(struct refine *refine, uint32_t kernel_sigma_px_q16);

/* Improves the marks that the patches name: ellipse, size and sigma. A circle whose pixels do not look as
 * they should (something covers a part of it, another edge) is taken out of its patch. */
void refine_marks(struct refine *refine, const struct frame_view *frame, struct patches *patches,
                  struct marks *marks);

/* The same for one mark whose ellipse is a prediction, by the frame's typical blur and noise: ellipse, colour and
 * size must be set. False where there is no such circle; *mark is then unchanged. After refine_marks. */
bool refine_predicted(const struct refine *refine, const struct frame_view *frame,
                      const struct pattern_edges *edges, const struct patch_light *light,
                      struct mark *mark);

/* Fits those of the patch's circles once more that feel the edges around them, or all where its light is known only now
 * (lit): the map through all that was found since, from the board to the image, knows better where edges lie. A fit
 * that is no good leaves a circle as it was. */
void refine_again(struct refine *refine, const struct frame_view *frame,
                  const struct boardmap *around, const struct patch_light *light, bool lit,
                  const struct patches *patches, struct patch *patch, struct marks *marks);

#endif
