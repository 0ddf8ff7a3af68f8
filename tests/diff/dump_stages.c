/* Writes what the detector's first stages make of a frame as CSV files, for comparison with the reference
 * in tests/ref:
 *
 *   dump_stages FRAME FOLDER
 *
 *   steer.csv     y,x,x_q3,y_q3,xx_q2,xy_q2,yy_q2,side
 *   edges.csv     across,row,column,x_q16,y_q16,squares_q6      row, column: the first of its two pixels
 *   contours.csv  contour,closed,x_q16,y_q16         points in their order
 *   fits.csv      contour,x_q16,y_q16,xx_q12,xy_q12,yy_q12,refit_x_q16,refit_y_q16,refit_xx_q12,
 *                 refit_xy_q12,refit_yy_q12,residual_q16,area_x_q16,area_y_q16,area_xx_q12,area_xy_q12,
 *                 area_yy_q12,area_residual_q12            of closed contours that all three fits take
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "firmware/app/image_file.h"
#include "firmware/app/pipeline.h"
#include "firmware/detect/areafit.h"
#include "firmware/detect/directfit.h"
#include "firmware/detect/refit.h"

static struct pipeline pipeline;

static FILE *create(const char *folder, const char *name, const char *columns)
{
    char path[4096];
    (void)snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "w");
    if (file == NULL) {
        perror(path);
        exit(1);
    }
    (void)fprintf(file, "%s\n", columns);
    return file;
}

static void finish(FILE *file)
{
    const bool bad = ferror(file) != 0;
    if (fclose(file) != 0 || bad) {
        perror("dump_stages: writing");
        exit(1);
    }
}

static void put_gradient(FILE *out, const struct dsp_gradient *g, unsigned y, unsigned width)
{
    for (unsigned x = 0; x < width; x++) {
        (void)fprintf(out, "%u,%u,%d,%d,%d,%d,%d,%d\n", y, x, g->x_q3[x], g->y_q3[x], g->xx_q2[x],
                      g->xy_q2[x], g->yy_q2[x], dsp_side(g, x));
    }
}

static void put_edges(FILE *out, const struct edge *edges, uint32_t count, int across, unsigned row)
{
    for (uint32_t i = 0; i < count; i++) {
        (void)fprintf(out, "%d,%u,%u,%" PRId32 ",%" PRId32 ",%" PRIu32 "\n", across, row,
                      edges[i].column, edges[i].x_px_q16, edges[i].y_px_q16, edges[i].squares_q6);
    }
}

static void put_ellipse(FILE *out, const struct ellipse *e)
{
    (void)fprintf(out, ",%" PRId32 ",%" PRId32 ",%" PRId32 ",%" PRId32 ",%" PRId32, e->x_px_q16,
                  e->y_px_q16, e->shape_xx_px2_q12, e->shape_xy_px2_q12, e->shape_yy_px2_q12);
}

/* Contours that are finished by now: their points, and the three fits of closed ones. */
static void put_contours(FILE *contours, FILE *fits, unsigned *number)
{
    struct contour *c = &pipeline.contour;
    while (chains_take(&pipeline.chains, ELLIPSES_POINTS_MIN, c)) {
        for (uint32_t i = 0; i < c->count; i++) {
            (void)fprintf(contours, "%u,%d,%" PRId32 ",%" PRId32 "\n", *number, c->closed,
                          c->x_px_q16[i], c->y_px_q16[i]);
        }
        struct ellipse direct;
        struct refit_quality quality;
        struct areafit area;
        if (c->closed && directfit_ellipse(c->x_px_q16, c->y_px_q16, c->count, &direct) &&
            areafit_ellipse(c->x_px_q16, c->y_px_q16, c->count, &area)) {
            struct ellipse refit = direct;
            if (refit_ellipse(c->x_px_q16, c->y_px_q16, c->count, &refit, &quality)) {
                (void)fprintf(fits, "%u", *number);
                put_ellipse(fits, &direct);
                put_ellipse(fits, &refit);
                (void)fprintf(fits, ",%" PRIu32, quality.residual_px_q16);
                put_ellipse(fits, &area.ellipse);
                (void)fprintf(fits, ",%" PRId32 "\n", area.residual_px2_q12);
            }
        }
        (*number)++;
    }
}

static void dump(const struct frame_view *frame, const char *folder)
{
    FILE *steer = create(folder, "steer.csv", "y,x,x_q3,y_q3,xx_q2,xy_q2,yy_q2,side");
    FILE *edges = create(folder, "edges.csv", "across,row,column,x_q16,y_q16,squares_q6");
    FILE *contours = create(folder, "contours.csv", "contour,closed,x_q16,y_q16");
    FILE *fits = create(folder, "fits.csv",
                        "contour,x_q16,y_q16,xx_q12,xy_q12,yy_q12,refit_x_q16,refit_y_q16,"
                        "refit_xx_q12,refit_xy_q12,refit_yy_q12,residual_q16,area_x_q16,area_y_q16,"
                        "area_xx_q12,area_xy_q12,area_yy_q12,area_residual_q12");
    steer_begin(&pipeline.steer);
    chains_begin(&pipeline.chains);
    const struct dsp_gradient *above = NULL;
    unsigned number = 0;
    for (uint16_t y = 0; y < frame->height_px; y++) {
        const struct dsp_gradient *row = steer_row(&pipeline.steer, frame, y);
        edges_scan_row(above, row, y, frame->width_px, &pipeline.edges);
        put_gradient(steer, row, y, frame->width_px);
        put_edges(edges, pipeline.edges.across, pipeline.edges.across_count, 1, y);
        put_edges(edges, pipeline.edges.down, pipeline.edges.down_count, 0, y - 1u);
        chains_link_row(&pipeline.chains, &pipeline.edges, y == 0);
        put_contours(contours, fits, &number);
        above = row;
    }
    chains_end(&pipeline.chains);
    put_contours(contours, fits, &number);
    finish(steer);
    finish(edges);
    finish(contours);
    finish(fits);
}

int main(int argc, char **argv)
{
    static struct image_file image;
    char error[IMAGE_FILE_ERROR_BYTES];
    if (argc != 3) {
        (void)fprintf(stderr, "usage: dump_stages FRAME FOLDER\n");
        return 2;
    }
    if (!image_file_read(argv[1], &image, error)) {
        (void)fprintf(stderr, "%s\n", error);
        return 1;
    }
    const struct pipeline_settings settings = pipeline_defaults();
    const size_t bytes = pipeline_bytes(image.frame.width_px, image.frame.height_px);
    void *memory = malloc(bytes);
    if (memory == NULL) {
        perror("dump_stages");
        return 1;
    }
    pipeline_init(&pipeline, memory, bytes, image.frame.width_px, image.frame.height_px, &settings);
    dump(&image.frame, argv[2]);
    free(memory);
    image_file_free(&image);
    return 0;
}
