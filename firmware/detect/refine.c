/* See refine.h: two steps for all circles, and between them what they say of each other. */
#include "firmware/detect/refine.h"

#include "common/fx/fx.h"

/* Noise that counts: so many times the frame's median, and over the contrast what the model leaves. Where no
 * target tells what lies beyond a patch, edges that reach into the band of small circles are left too. */
#define NOISE_BINS        256u
#define NOISE_BIN_Q16     16u /* a grey level is 256 */
#define NOISE_SHARE_Q8    512 /* 2 */
#define WORST_SHARE_Q8    768 /* 3 */
#define SLACK_KNOWN_Q16   262 /* 0.004 */
#define SLACK_UNKNOWN_Q16 786 /* 0.012 */
#define AGAIN_PX_Q16      3932 /* 0.06 */
#define AGAIN_LIT_PX_Q16  13107 /* 0.2 */
/* Circles of so many blurs tell the blur best, and small ones start from theirs. */
#define LARGE_SIGMAS 6
#define SMALL_SIGMAS 4
/* The anchor fills one quarter of a patch, four small circles each of the others. */
#define QUARTERS      4u
#define QUARTER_SMALL 4u

void refine_init(struct refine *refine, struct arena *arena, const struct dsp_kernels *dsp,
                 const struct patches_settings *settings, uint32_t kernel_sigma_px_q16)
{
    circlefit_init(&refine->fit, arena, dsp, settings, kernel_sigma_px_q16);
    light_init(&refine->light, arena);
    refine->views = arena_take(arena, LAYOUT_FEATURES_MAX, sizeof(struct rim_view));
    refine->pairs = arena_take(arena, LAYOUT_FEATURES_LEVEL2, sizeof(struct boardmap_pair));
}

void refine_set_kernel(struct refine *refine, uint32_t kernel_sigma_px_q16)
{
    refine->fit.kernel_sigma_px_q16 = kernel_sigma_px_q16;
}

/* A circle's noise over its contrast, as it is in the image: shading changes the contrast, not the noise. */
static int64_t in_image_q16(uint16_t over_contrast_q16, const struct mark *mark)
{
    return (over_contrast_q16 * fx_abs_i64(mark->contrast_q30)) >> 30;
}

/* Whether the pixels are as quiet as the frame's others, all around. */
static bool is_clean(const struct refine *refine, const struct mark *mark)
{
    const int64_t slack_q16 = (refine->slack_q16 * fx_abs_i64(mark->contrast_q30)) >> 30;
    return in_image_q16(mark->noise_q16, mark) <= refine->noise_max_q16 + slack_q16 &&
           in_image_q16(mark->worst_q16, mark) <= refine->worst_max_q16 + 2 * slack_q16;
}

bool refine_predicted(const struct refine *refine, const struct frame_view *frame,
                      const struct pattern_edges *edges, const struct patch_light *light,
                      struct mark *mark)
{
    struct rim_view view;
    if (refine->blur_px_q16 == 0 || !circlefit_start(&refine->fit, mark, &view)) {
        return false;
    }
    view.edges = *edges;
    view.blur_px_q16 = view.size_px_q16 < SMALL_SIGMAS * (int64_t)refine->edge_blur_px_q16
                           ? refine->edge_blur_px_q16
                           : refine->blur_px_q16;
    view.edge_blur_px_q16 = refine->edge_blur_px_q16;
    struct mark fitted = *mark;
    if (!circlefit_coarse(&refine->fit, frame, &view, mark->white)) {
        return false;
    }
    light_tilt(light, mark->white, &view);
    if (!circlefit_fine(&refine->fit, frame, &view, &fitted) || !is_clean(refine, &fitted)) {
        return false;
    }
    fitted.level_q30 = fx_saturate_i32(view.level_q30);
    *mark = fitted;
    return true;
}

/* The mean blur of the circles seen so far: of all, and of large ones. */
struct blur_sums {
    int64_t  all_px_q16;
    int64_t  large_px_q16;
    uint32_t all;
    uint32_t large;
};

static bool is_large(const struct rim_view *view)
{
    return view->size_px_q16 > LARGE_SIGMAS * (int64_t)view->blur_px_q16;
}

static void add_blur(struct blur_sums *sums, const struct rim_view *view)
{
    sums->all_px_q16 += view->blur_px_q16;
    sums->all++;
    if (is_large(view)) {
        sums->large_px_q16 += view->blur_px_q16;
        sums->large++;
    }
}

static void take_blurs(const struct blur_sums *sums, struct refine *refine)
{
    refine->blur_px_q16 = sums->all > 0 ? (int32_t)(sums->all_px_q16 / sums->all) : 0;
    refine->edge_blur_px_q16 =
        sums->large > 0 ? (int32_t)(sums->large_px_q16 / sums->large) : refine->blur_px_q16;
}

static void place_patch(const struct patches *patches, const struct patch *patch,
                        struct pattern_patch *pattern)
{
    const struct target *target = patches->settings.target;
    uint16_t row = 0;
    uint16_t col = 0;
    uint8_t turn = 0;
    if (target != NULL && !target_find(target, patch->id, &row, &col, &turn)) {
        target = NULL;
    }
    *pattern = (struct pattern_patch){
        .target = target,
        .levels = patches->settings.levels,
        .id = patch->id,
        .row = row,
        .col = col,
        .turned = turn != 0,
    };
}

/* The blur that the patch's anchor tells where it is large, else the frame's; the anchor's again, or 0, before that
 * is known. */
static int32_t patch_blur_px_q16(const struct refine *refine, const struct patch *patch)
{
    if (patch->marks[LAYOUT_ANCHOR] == MARKS_NONE) {
        return refine->edge_blur_px_q16;
    }
    const struct rim_view *anchor = &refine->views[LAYOUT_ANCHOR];
    return is_large(anchor) || refine->edge_blur_px_q16 == 0 ? anchor->blur_px_q16
                                                            : refine->edge_blur_px_q16;
}

/* Whether no circle of the patch feels an edge; the small ones are all alike. */
static bool is_roomy(const struct refine *refine, const struct patch *patch, unsigned levels,
                     int32_t blur_px_q16)
{
    for (unsigned i = LAYOUT_ANCHOR + 1; i < LAYOUT_FEATURES_LEVEL2; i++) {
        if (patch->marks[i] != MARKS_NONE) {
            const struct rim_view *view = &refine->views[i];
            return levels == 2 && circlefit_is_roomy(view, blur_px_q16 > 0 ? blur_px_q16
                                                                          : view->blur_px_q16);
        }
    }
    return false;
}

/* The board around the patch as its own circles tell it so far. False where a side of it is missing: the map would have
 * to reach too far. */
static bool map_patch(struct refine *refine, const struct patch *patch,
                      const struct pattern_patch *pattern, struct boardmap *map)
{
    uint32_t count = 0;
    uint32_t of_quarter[QUARTERS] = {0};
    for (unsigned i = 0; i < LAYOUT_FEATURES_LEVEL2; i++) {
        if (patch->marks[i] != MARKS_NONE) {
            const struct layout_feature *f = layout_feature(pattern->levels, i);
            struct boardmap_pair *pair = &refine->pairs[count++];
            pattern_to_board(pattern, f->u_q30 >> 6, f->v_q30 >> 6, &pair->u_q24, &pair->v_q24);
            pair->x_px_q16 = refine->views[i].ellipse.x_px_q16;
            pair->y_px_q16 = refine->views[i].ellipse.y_px_q16;
            of_quarter[i == LAYOUT_ANCHOR ? 0 : (i - 1) / QUARTER_SMALL + 1]++;
        }
    }
    bool whole = of_quarter[0] > 0;
    for (unsigned i = 1; i < QUARTERS; i++) {
        whole &= of_quarter[i] > 1;
    }
    return whole && boardmap_fit(refine->pairs, count, map);
}

/* Tells every circle of the patch what is printed around it, and how sharp the anchor says that edges are. The map
 * is the patch's own or, where it has none, that of all around (NULL: not known yet), which reaches over more than one
 * polynomial can follow: it tells how far edges are from the circle, but not where both are. */
static void describe_patch(struct refine *refine, const struct patch *patch,
                           const struct pattern_patch *pattern, const struct boardmap *around)
{
    const int32_t blur_px_q16 = patch_blur_px_q16(refine, patch);
    if (is_roomy(refine, patch, pattern->levels, blur_px_q16)) {
        return;
    }
    struct boardmap own;
    const struct boardmap *map = map_patch(refine, patch, pattern, &own) ? &own : around;
    if (map == NULL) {
        return;
    }
    for (unsigned i = 0; i < layout_feature_count(pattern->levels); i++) {
        struct rim_view *view = &refine->views[i];
        const int32_t edge_blur_px_q16 = blur_px_q16 > 0 ? blur_px_q16 : view->blur_px_q16;
        if (patch->marks[i] != MARKS_NONE && !circlefit_is_roomy(view, edge_blur_px_q16)) {
            pattern_edges_of(pattern, i, map, &view->edges);
            if (map == around) {
                pattern_edges_move(&view->edges, view->ellipse.x_px_q16, view->ellipse.y_px_q16);
            }
            view->edge_blur_px_q16 = edge_blur_px_q16;
        }
    }
}

/* The value that half of the counted ones do not exceed. */
static uint32_t median_bin(const uint32_t bins[NOISE_BINS], uint32_t count)
{
    uint32_t below = 0;
    for (uint32_t bin = 0; bin < NOISE_BINS; bin++) {
        below += bins[bin];
        if (2 * below >= count) {
            return bin;
        }
    }
    return NOISE_BINS - 1;
}

/* Takes a feature out of its patch. */
static void refuse(struct refine *refine, struct patch *patch, unsigned feature)
{
    patch->marks[feature] = MARKS_NONE;
    patch->feature_count--;
    refine->refused++;
}

/* The anchor, which comes first, tells the blur best, unless something covers it. */
static bool fit_coarsely(const struct refine *refine, const struct frame_view *frame,
                         int32_t anchor_blur_px_q16, bool white, struct rim_view *view)
{
    const struct rim_view start = *view;
    if (anchor_blur_px_q16 > 0) {
        view->blur_px_q16 = anchor_blur_px_q16;
        if (circlefit_coarse(&refine->fit, frame, view, white)) {
            return true;
        }
        *view = start;
    }
    return circlefit_coarse(&refine->fit, frame, view, white);
}

/* The first step of all circles of a patch, kept in their marks. */
static void refine_coarsely(struct refine *refine, const struct frame_view *frame,
                            const struct patches *patches, struct patch *patch, struct marks *marks,
                            struct blur_sums *blurs)
{
    struct pattern_patch pattern;
    place_patch(patches, patch, &pattern);
    for (unsigned i = 0; i < layout_feature_count(patches->settings.levels); i++) {
        if (patch->marks[i] != MARKS_NONE &&
            (!circlefit_start(&refine->fit, &marks->at[patch->marks[i]], &refine->views[i]) ||
             !circlefit_estimate_blur(&refine->fit, frame, &marks->at[patch->marks[i]], &refine->views[i]))) {
            refuse(refine, patch, i);
        }
    }
    describe_patch(refine, patch, &pattern, NULL);
    int32_t anchor_blur_px_q16 = 0;
    for (unsigned i = 0; i < layout_feature_count(patches->settings.levels); i++) {
        if (patch->marks[i] == MARKS_NONE) {
            continue;
        }
        struct mark *mark = &marks->at[patch->marks[i]];
        struct rim_view *view = &refine->views[i];
        if (fit_coarsely(refine, frame, anchor_blur_px_q16, mark->white, view)) {
            mark->ellipse = view->ellipse;
            mark->size_px_q16 = view->size_px_q16;
            mark->blur_px_q16 = view->blur_px_q16;
            mark->level_q30 = fx_saturate_i32(view->level_q30);
            mark->contrast_q30 = fx_saturate_i32(view->contrast_q30);
            add_blur(blurs, view);
            anchor_blur_px_q16 = i == LAYOUT_ANCHOR ? view->blur_px_q16 : anchor_blur_px_q16;
        } else {
            refuse(refine, patch, i);
        }
    }
}

/* Views of the patch's circles as they were fitted so far, with the edges that follow from all of them. */
static void continue_from_marks(struct refine *refine, const struct patches *patches,
                                struct patch *patch, const struct boardmap *around,
                                const struct marks *marks)
{
    struct pattern_patch pattern;
    place_patch(patches, patch, &pattern);
    for (unsigned i = 0; i < layout_feature_count(patches->settings.levels); i++) {
        if (patch->marks[i] == MARKS_NONE) {
            continue;
        }
        const struct mark *mark = &marks->at[patch->marks[i]];
        struct rim_view *view = &refine->views[i];
        if (!circlefit_start(&refine->fit, mark, view)) {
            refuse(refine, patch, i);
            continue;
        }
        view->blur_px_q16 = mark->blur_px_q16;
        view->level_q30 = mark->level_q30;
        view->contrast_q30 = mark->contrast_q30;
        view->fine = true;
    }
    describe_patch(refine, patch, &pattern, around);
}

/* The second step, with what all circles around have said of edges and light; gathers noise and blur. */
static void refine_finely(struct refine *refine, const struct frame_view *frame,
                          const struct patches *patches, struct patch *patch, struct marks *marks,
                          uint32_t bins[NOISE_BINS], struct blur_sums *blurs)
{
    continue_from_marks(refine, patches, patch, NULL, marks);
    const int32_t blur_px_q16 = patch_blur_px_q16(refine, patch);
    light_find(&refine->light, patch, marks);
    for (unsigned i = 0; i < layout_feature_count(patches->settings.levels); i++) {
        if (patch->marks[i] == MARKS_NONE) {
            continue;
        }
        struct mark *mark = &marks->at[patch->marks[i]];
        struct rim_view *view = &refine->views[i];
        light_tilt(&patch->light, mark->white, view);
        if (blur_px_q16 > 0 && view->size_px_q16 < SMALL_SIGMAS * (int64_t)blur_px_q16) {
            view->blur_px_q16 = blur_px_q16;
        }
        if (circlefit_fine(&refine->fit, frame, view, mark)) {
            const uint32_t bin = (uint32_t)(in_image_q16(mark->noise_q16, mark) / NOISE_BIN_Q16);
            bins[bin < NOISE_BINS ? bin : NOISE_BINS - 1]++;
            add_blur(blurs, view);
            refine->refined++;
        } else {
            refuse(refine, patch, i);
        }
    }
}

void refine_marks(struct refine *refine, const struct frame_view *frame, struct patches *patches,
                  struct marks *marks)
{
    uint32_t bins[NOISE_BINS] = {0};
    struct blur_sums coarse = {0};
    struct blur_sums fine = {0};
    refine->refined = 0;
    refine->refused = 0;
    refine->blur_px_q16 = 0;
    refine->edge_blur_px_q16 = 0;
    refine->noise_max_q16 = 0;
    refine->worst_max_q16 = 0;
    refine->slack_q16 = patches->settings.target != NULL ? SLACK_KNOWN_Q16 : SLACK_UNKNOWN_Q16;
    for (uint32_t i = 0; i < patches->count; i++) {
        refine_coarsely(refine, frame, patches, &patches->at[i], marks, &coarse);
    }
    take_blurs(&coarse, refine);
    for (uint32_t i = 0; i < patches->count; i++) {
        refine_finely(refine, frame, patches, &patches->at[i], marks, bins, &fine);
    }
    if (refine->refined == 0) {
        refine->blur_px_q16 = 0;
        return;
    }
    take_blurs(&fine, refine);
    /* A circle with a tenth of its rim covered leaves a residual of 0.3 of its contrast. */
    const int64_t median_q16 = (median_bin(bins, refine->refined) + 1) * NOISE_BIN_Q16;
    refine->noise_max_q16 = (NOISE_SHARE_Q8 * median_q16) >> 8;
    refine->worst_max_q16 = (WORST_SHARE_Q8 * median_q16) >> 8;
    for (uint32_t i = 0; i < patches->count; i++) {
        struct patch *patch = &patches->at[i];
        for (unsigned feature = 0; feature < layout_feature_count(patches->settings.levels); feature++) {
            if (patch->marks[feature] != MARKS_NONE &&
                !is_clean(refine, &marks->at[patch->marks[feature]])) {
                refuse(refine, patch, feature);
            }
        }
    }
}

/* The square of how far a circle lies from where the map has it. */
static int64_t off_map_q32(const struct mark *mark, const struct pattern_edges *edges)
{
    const int64_t dx = (int64_t)mark->ellipse.x_px_q16 - edges->x_px_q16;
    const int64_t dy = (int64_t)mark->ellipse.y_px_q16 - edges->y_px_q16;
    return dx * dx + dy * dy;
}

/* Within two sigmas in x and y, or as far as edges may have been misplaced or light unknown; farther, only towards the
 * place where the map has it. */
static bool is_better(const struct mark *before, const struct mark *now,
                      const struct pattern_edges *edges, bool lit)
{
    const int64_t two_px_q16 = before->sigma_px_q20 >> 3;
    const int64_t least_px_q16 = lit ? AGAIN_LIT_PX_Q16 : AGAIN_PX_Q16;
    const int64_t reach_px_q16 = two_px_q16 > least_px_q16 ? two_px_q16 : least_px_q16;
    const bool near =
        fx_abs_i64((int64_t)now->ellipse.x_px_q16 - before->ellipse.x_px_q16) <= reach_px_q16 &&
        fx_abs_i64((int64_t)now->ellipse.y_px_q16 - before->ellipse.y_px_q16) <= reach_px_q16;
    return near || off_map_q32(now, edges) < off_map_q32(before, edges);
}

void refine_again(struct refine *refine, const struct frame_view *frame,
                  const struct boardmap *around, const struct patch_light *light, bool lit,
                  const struct patches *patches, struct patch *patch, struct marks *marks)
{
    continue_from_marks(refine, patches, patch, around, marks);
    for (unsigned i = 0; i < layout_feature_count(patches->settings.levels); i++) {
        struct rim_view *view = &refine->views[i];
        if (patch->marks[i] == MARKS_NONE ||
            (!lit && circlefit_is_roomy(view, refine->edge_blur_px_q16))) {
            continue;
        }
        struct mark *mark = &marks->at[patch->marks[i]];
        struct mark fitted = *mark;
        light_tilt(light, mark->white, view);
        if (circlefit_fine(&refine->fit, frame, view, &fitted) && is_clean(refine, &fitted) &&
            is_better(mark, &fitted, &view->edges, lit)) {
            *mark = fitted;
        }
    }
}
